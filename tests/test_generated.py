"""generated/ is what `make generated` makes: same bytes and numbers, pictures with something on."""

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import snakegen
from snakegen.report.collection import collect
from snakegen.report.page import plain, to_json
from snakegen.robot.posture import hover_gimbals, read_posture
from snakegen.spec.loading import presets, templates_folder

ROOT = Path(__file__).parent.parent / "generated"
NAMES = sorted(presets())


@pytest.mark.parametrize("name", NAMES)
def test_same_bytes(name: str, tmp_path: Path) -> None:
    """URDF, MJCF, scene, resolved spec and meshes are the committed ones, byte for byte."""
    snakegen.build(name, tmp_path / name, picture=False)
    made = {p.relative_to(tmp_path / name) for p in (tmp_path / name).rglob("*") if p.is_file()}
    assert {f"{name}.urdf", f"{name}.xml", "scene.xml", f"{name}.spec.yaml"} <= set(map(str, made))
    for file in sorted(made):
        committed = ROOT / name / file
        assert committed.is_file(), f"{file} is not committed; run `make generated`"
        same = committed.read_bytes() == (tmp_path / name / file).read_bytes()
        assert same, f"{file} is not what the build makes; run `make generated`"
    meshes = {p.name for p in (ROOT / name / "meshes").glob("*")}
    assert meshes == {p.name for p in made if p.parent.name == "meshes"}


@pytest.mark.parametrize("name", NAMES)
def test_same_numbers(name: str) -> None:
    """report.json is what the analyses say now, to nine digits."""
    robot = snakegen.load(ROOT / name / f"{name}.urdf")
    file = templates_folder() / "presets" / "postures" / f"{name}.yaml"
    posture = read_posture(file) if file.is_file() else {}
    q = hover_gimbals(robot, robot.configuration(posture))
    now = json.loads(json.dumps(plain(to_json(collect(robot, q)))))
    then = json.loads((ROOT / name / "report.json").read_text(encoding="utf-8"))
    assert differences(then, now, "") == []


OWN = {  # of numbers that are known less well than to nine digits: relative, of the largest entry
    r"\.control\.loops\..*\.poles_per_s": 1e-6,  # near-double roots: √ε
    r"\.margin\.joint_limited\..*\.(force|torque)$": 1e-3,  # bounds, closed to this
    # directions of bounds that are closed to 1e-4: its root
    r"\.margin\.(push\.)?virtual_single_rotor\..*\.(worst_direction|push)$": 1e-2,
    r"\.drive\.weakest_shape_rad": 1e-6,  # where a search ended: √ε
}


def differences(a: Any, b: Any, place: str, known: float = 1e-9) -> list[str]:
    """Returns the places where plain data differs by more than what is `known`, or its tolerance.

    Where certified bounds stand beside a value, it is known to the gap between them: two searches
    that both hold the true value differ by no more than the wider gap.
    """
    own = next((t for pattern, t in OWN.items() if re.match(pattern, place)), known)
    if isinstance(a, dict) and isinstance(b, dict):
        if a.keys() != b.keys():
            return [f"{place}: {sorted(a.keys() ^ b.keys())}"]
        own = max(own, _gap(a.get("bounds")), _gap(b.get("bounds")))
        return [d for k in a for d in differences(a[k], b[k], f"{place}.{k}", own)]
    if isinstance(a, list) and isinstance(b, list):
        if _numbers(a) and _numbers(b) and len(a) == len(b):
            scale = max([abs(x) for x in (*a, *b)], default=0.0)
            far = any(abs(x - y) > own * max(scale, 1e-3) for x, y in zip(a, b, strict=True))
            return [f"{place}: {a} | {b}"] if far else []
        if len(a) != len(b):
            return [f"{place}: {len(a)} | {len(b)} entries"]
        return [d for i in range(len(a)) for d in differences(a[i], b[i], f"{place}[{i}]", own)]
    if isinstance(a, float) and isinstance(b, int | float) and not isinstance(b, bool):
        return [] if math.isclose(a, b, rel_tol=own, abs_tol=1e-12) else [f"{place}: {a} | {b}"]
    return [] if a == b else [f"{place}: {a!r} | {b!r}"]


def _gap(bounds: Any) -> float:
    """Returns (upper - lower)/upper of certified bounds, 0 where there are none."""
    if not isinstance(bounds, list) or len(bounds) != 2 or not _numbers(bounds):
        return 0.0
    return float((bounds[1] - bounds[0]) / max(abs(bounds[1]), 1e-12))


def _numbers(values: list[Any]) -> bool:
    return all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)


def test_differences_are_seen() -> None:
    """A number off in the eighth digit, a missing key and another word are each found."""
    good = {"a": 1.0, "b": [1.0, 2.0], "c": "x", "d": None, "e": True}
    assert differences(good, dict(good), "") == []
    for key, value in (("a", 1.00000002), ("b", [1.0, 2.00000004]), ("c", "y"), ("e", False)):
        assert differences(good, good | {key: value}, "")
    assert differences(good, {k: v for k, v in good.items() if k != "d"}, "")
    bounded = {"value": 1.0, "bounds": [1.0, 1.001]}
    assert differences(bounded, {"value": 1.0009, "bounds": [1.0009, 1.001]}, "") == []
    assert differences(bounded, {"value": 1.002, "bounds": [1.002, 1.0021]}, "")


@pytest.mark.parametrize("name", NAMES)
def test_pictures_show_something(name: str) -> None:
    """The robot's picture and every plot of the report are there and not blank."""
    report = (ROOT / name / "report.md").read_text(encoding="utf-8")
    pictures = sorted((ROOT / name).glob("*.png"))
    assert ROOT / name / f"{name}.png" in pictures
    for picture in pictures:
        assert f"({picture.name})" in report
        pixels = np.asarray(Image.open(picture).convert("L"), float)
        assert pixels.std() > 3 and min(pixels.shape) > 200
    size = sum(p.stat().st_size for p in (ROOT / name).rglob("*") if p.is_file())
    assert size < 3_000_000
