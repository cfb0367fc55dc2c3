"""The templates work without snakegen: stock xacro on the resolved spec gives the same bytes."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from snakegen.base import yaml_file
from snakegen.errors import DescriptionError
from snakegen.spec.loading import load_spec, presets, templates_folder
from snakegen.spec.urdf import expand

VARIANTS = [
    *[(name, {}) for name in sorted(presets())],
    ("dragon4", {"links": 1}),
    ("dragon4", {"links": 17, "apparatus": "1,9@0.3,17@1"}),
    ("dragon4", {"overrides": ["vectoring_apparatus.rotors=1", "about='a < b & c > d'"]}),
    ("dragon4", {"overrides": ["payload={at: ['2@0.1', 4], mass: 0.5}", "base=fixed"]}),
]


def body(text: str, banner: str, lines: int) -> list[str]:
    """Returns the lines after the XML declaration and a banner of `lines` that matches."""
    rows = text.splitlines()
    assert rows[0].startswith("<?xml")
    assert all(re.match(banner, row) for row in rows[1 : 1 + lines])
    assert not re.match(banner, rows[1 + lines])
    return rows[1 + lines :]


@pytest.mark.parametrize(("name", "changes"), VARIANTS, ids=lambda v: str(v))
def test_stock_xacro_gives_the_same(name: str, changes: dict, tmp_path: Path) -> None:
    """`xacro snake.urdf.xacro spec:=…` in a process without snakegen: the same after the banner."""
    spec = tmp_path / "robot.spec.yaml"
    resolved = load_spec(name, **changes).resolved()
    spec.write_text(yaml_file.dump(resolved), encoding="utf-8")
    ran = subprocess.run(
        [
            sys.executable,
            "-c",
            "import sys, xacro; xacro.main(); assert 'snakegen' not in sys.modules",
            str(templates_folder() / "snake.urdf.xacro"),
            f"spec:={spec}",
        ],
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
    )
    stock = body(ran.stdout, r"<!-- (=+|\|.*\|) -->", 4)
    ours = body(expand(spec), r"<!-- Made by snakegen", 1)
    assert stock == ours
    assert len(ours) > 20


def test_the_banner_names_no_path(tmp_path: Path) -> None:
    """xacro's banner carries the template's absolute path; ours names the spec alone."""
    spec = tmp_path / "robot.spec.yaml"
    spec.write_text(yaml_file.dump(load_spec("dragon4").resolved()), encoding="utf-8")
    text = expand(spec)
    assert str(templates_folder()) not in text and str(tmp_path) not in text
    assert text.splitlines()[1].startswith("<!-- Made by snakegen from robot.spec.yaml")


def test_a_failure_leaves_no_trace(tmp_path: Path) -> None:
    """xacro keeps module state; after a spec that fails, a good one gives what it gave before."""
    good, bad = tmp_path / "good.spec.yaml", tmp_path / "bad.spec.yaml"
    resolved = load_spec("dragon4").resolved()
    good.write_text(yaml_file.dump(resolved), encoding="utf-8")
    del resolved["chain"]["length"]
    bad.write_text(yaml_file.dump(resolved), encoding="utf-8")
    before = expand(good)
    with pytest.raises(DescriptionError, match=r"bad\.spec\.yaml: the templates do not expand"):
        expand(bad)
    again = expand(good, "elsewhere/")  # the latest expansions are kept, this is none of them
    assert again.replace("elsewhere/", "meshes/") == before != again
