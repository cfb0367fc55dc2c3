"""Fuzzing: broken robots and specs end in a finding or in one line, never in a traceback."""

import math
import os
import tempfile
import warnings
from pathlib import Path
from typing import Any

import pytest
from clean_urdf import GOOD
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

import snakegen
from snakegen.base import yaml_file
from snakegen.base.file_name import file_stem
from snakegen.errors import SnakegenError
from snakegen.spec.loading import load_spec
from tests.examples import EXAMPLES
from tests.foreign_robots import ROBOTS
from tests.test_compare import ARM

ROOT = Path(__file__).parent.parent
MJCF = (ROOT / "generated/arm6/arm6.xml").read_text()
BASES = (GOOD, ARM, MJCF, *(make() for make in ROBOTS.values()))
SPECS = sorted((ROOT / "templates/presets").glob("*.yaml"))
SEED = int(os.environ.get("SNAKEGEN_SEED", "0"))
_FEW = settings(
    max_examples=EXAMPLES,
    deadline=None,
    database=None,
    suppress_health_check=list(HealthCheck),
)
_VALUES = st.sampled_from(
    ["", "0", "-1", "1e999", "nan", "-inf", "1e-320", "1e308", "0 0 0", "1 2", "x", "../../etc",
     "base", "world", "revolute", "floating", "planar", "fixed", "a b", "é", "${1/0}", "$(env X)",
     "package://../../x.stl", "/dev/zero", "\u202e", "9" * 400, "0x10", "1_0", "true"]
)  # fmt: skip


@st.composite
def urdfs(draw: st.DrawFn) -> str:
    """Returns a sound URDF with one to four mutations of its text."""
    text = draw(st.sampled_from(BASES))
    for _ in range(draw(st.integers(1, 4))):
        quotes = [i for i, c in enumerate(text) if c == '"']
        opens = [i for i, c in enumerate(text) if c == "<"]
        kind = draw(st.sampled_from(("value", "cut", "drop", "twice", "insert", "swap")))
        if kind == "value" and len(quotes) >= 2:
            k = 2 * draw(st.integers(0, len(quotes) // 2 - 1))
            text = text[: quotes[k] + 1] + draw(_VALUES) + text[quotes[k + 1] :]
        elif kind == "cut":
            text = text[: draw(st.integers(0, len(text)))]
        elif kind in ("drop", "twice") and len(opens) >= 2:
            i = draw(st.integers(0, len(opens) - 2))
            j = opens[min(i + draw(st.integers(1, 4)), len(opens) - 1)]
            part = text[opens[i] : j]
            text = text[: opens[i]] + (part * 2 if kind == "twice" else "") + text[j:]
        elif kind == "insert":
            i = draw(st.integers(0, len(text)))
            more = draw(st.text(max_size=6) | st.sampled_from(("<", "&x;", "<!DOCTYPE r>", "\0")))
            text = text[:i] + more + text[i:]
        elif len(quotes) >= 4:
            a, b = (2 * draw(st.integers(0, len(quotes) // 2 - 1)) for _ in range(2))
            one, other = (text[quotes[k] + 1 : quotes[k + 1]] for k in (a, b))
            text = text[: quotes[a] + 1] + other + text[quotes[a + 1] :]
            text = text.replace(f'"{other}"', f'"{one}"', draw(st.integers(0, 2)))
    return text


@pytest.fixture(scope="module")
def folder() -> Any:
    with tempfile.TemporaryDirectory() as made, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        (Path(made) / "good.urdf").write_text(ARM)
        snakegen.convert(Path(made) / "good.urdf", Path(made) / "good")
        yield Path(made)


def attempt(call: Any, *args: Any, **options: Any) -> bool:
    """Calls; a user's mistake is one line that names something, everything else an error here."""
    try:
        call(*args, **options)
    except SnakegenError as error:
        assert str(error).strip()
        return False
    return True


@seed(SEED)
@_FEW
@given(text=urdfs())
def test_fuzz_of_urdfs(folder: Path, text: str) -> None:
    path = folder / "fuzzed.urdf"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    found = snakegen.lint(path)
    assert all(f.message and f.remedy for f in found)
    loaded = attempt(snakegen.load, path)
    if any(f.severity == "error" for f in found):
        assert not loaded, [str(f) for f in found if f.severity == "error"]
    attempt(snakegen.compare, path, folder / "good/arm.xml")
    attempt(snakegen.convert, path, folder / "out")
    if attempt(snakegen.adopt, path):
        attempt(snakegen.load, path, modules=snakegen.adopt(path))


_LEAF = (
    st.none()
    | st.booleans()
    | st.integers(-3, 12)
    | st.floats()
    | st.sampled_from(("", "x", "${1/0}", "$(env X)", "1,2", "../x", "é" * 50))
    | st.lists(st.floats(allow_nan=True) | st.text(max_size=3), max_size=5)
    | st.dictionaries(st.text(max_size=4), st.integers(), max_size=2)
)


@st.composite
def specs(draw: st.DrawFn) -> Any:
    """Returns a preset with one to three values replaced, removed or added."""
    data = yaml_file.read(draw(st.sampled_from(SPECS)))
    for _ in range(draw(st.integers(1, 3))):
        here = data
        while True:
            key = draw(st.sampled_from(sorted(here, key=str)))
            if isinstance(here[key], dict) and here[key] and draw(st.booleans()):
                here = here[key]
                continue
            break
        kind = draw(st.sampled_from(("replace", "remove", "add")))
        if kind == "replace":
            here[key] = draw(_LEAF)
        elif kind == "remove" and len(here) > 1:
            del here[key]
        else:
            here[draw(st.text(max_size=5))] = draw(_LEAF)
    return data


@seed(SEED)
@_FEW
@given(data=specs())
def test_fuzz_of_specs(data: Any) -> None:
    attempt(lambda: snakegen.load(load_spec(data)) if _small(data) else load_spec(data))


def _small(data: Any) -> bool:
    """Tells whether a robot of that spec is quickly made."""
    links = data.get("chain", {}).get("links") if isinstance(data.get("chain"), dict) else None
    return isinstance(links, int) and 0 < links <= 12


_FIELDS = (
    *("floating_root", "link_length", "apparatuses", "servos", "control", "plant", "thrust_max"),
    *("axis", "position", "rotors", "roll", "pitch", "link", "name", "drag_ratio", "x"),
)
_TREE = st.recursive(
    _LEAF | st.sampled_from(("base_link", "rotor_1", "rotor_1_joint")),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(_FIELDS), inner, max_size=4)
    ),
    max_leaves=12,
)


@seed(SEED)
@_FEW
@given(
    changes=st.dictionaries(st.sampled_from(_FIELDS), _TREE, max_size=3), where=st.integers(0, 2)
)
def test_fuzz_of_modules(folder: Path, changes: dict[str, Any], where: int) -> None:
    path = folder / "hexa.urdf"
    if not path.exists():
        path.write_text(ROBOTS["hexa"]())
    data = snakegen.adopt(path)
    (data, data["apparatuses"][0], data["apparatuses"][0]["rotors"][0])[where].update(changes)
    attempt(snakegen.load, path, modules=data)


def test_entities_and_outside_files_are_refused(folder: Path) -> None:
    bomb = "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 12))
    for head in (f'<!DOCTYPE r [<!ENTITY a0 "x">{bomb}]>',
                 '<!DOCTYPE r [<!ENTITY a11 SYSTEM "file:///etc/passwd">]>'):  # fmt: skip
        for name, root in (("bomb.urdf", ARM), ("bomb.xml", "<mujoco>&a11;</mujoco>")):
            path = folder / name
            path.write_text(head + root.replace("upper", "&a11;"))
            assert [f.code for f in snakegen.lint(path)] == ["doctype"]
            for call in (snakegen.load, snakegen.adopt, snakegen.convert):
                assert not attempt(call, path)
            assert not attempt(snakegen.compare, path, folder / "good/arm.xml")


@pytest.mark.parametrize("name", ["../../escape", "/tmp/escape", "a/b", "..", ".", "", "a\nb"])
def test_a_robots_name_does_not_leave_the_folder(tmp_path: Path, name: str) -> None:
    shown = name.replace("\n", "&#10;")
    (tmp_path / "in").mkdir()
    path = tmp_path / "in/robot.urdf"
    path.write_text(ARM.replace('name="arm"', f'name="{shown}"'))
    before = set(tmp_path.rglob("*"))
    attempt(snakegen.convert, path, tmp_path / "in/out")
    made = set(tmp_path.rglob("*")) - before
    assert all(p.is_relative_to(tmp_path / "in/out") for p in made), made
    assert not Path(f"{name}.urdf").is_absolute() or not Path(f"{name}.urdf").exists()
    assert file_stem(name) == Path(file_stem(name)).name


def test_a_mesh_above_the_folder_is_copied_by_its_name_alone(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "secret.stl").write_bytes(b"solid\nendsolid\n")
    mesh = '<visual><geometry><mesh filename="../secret.stl"/></geometry></visual>'
    path = tmp_path / "in/robot.urdf"
    path.write_text(ARM.replace('<link name="upper">', f'<link name="upper">{mesh}'))
    made = snakegen.convert(path, tmp_path / "in/out")
    assert "../" not in made.urdf.read_text() and "../" not in made.mjcf.read_text()


def test_ten_thousand_links_and_deep_nesting_end_in_time(tmp_path: Path) -> None:
    wide = "".join(
        f'<link name="l{i}"/><joint name="j{i}" type="fixed"><parent link="base"/>'
        f'<child link="l{i}"/></joint>'
        for i in range(10_000)
    )
    path = tmp_path / "wide.urdf"
    path.write_text(ARM.replace("</robot>", f"{wide}</robot>"))
    assert not [f for f in snakegen.lint(path) if f.severity == "error"]
    assert snakegen.load(path).mass > 0
    assert not attempt(snakegen.adopt, path)
    nested = tmp_path / "nested.urdf"
    nested.write_text("<robot name='r'>" + "<a>" * 50_000 + "</a>" * 50_000 + "</robot>")
    snakegen.lint(nested)
    attempt(snakegen.load, nested)
    mjcf = tmp_path / "nested.xml"
    mjcf.write_text(
        f"<mujoco><worldbody>{'<body>' * 20_000}{'</body>' * 20_000}</worldbody></mujoco>"
    )
    snakegen.lint(mjcf)
    assert not attempt(snakegen.compare, mjcf, mjcf)


def test_100_megabytes_are_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "huge.urdf"
    with path.open("wb") as file:
        file.write(b"<robot name='r'>")
        file.truncate(120_000_000)
    for call in (snakegen.load, snakegen.adopt, snakegen.convert):
        assert not attempt(call, path)
    assert not attempt(snakegen.compare, path, path)
    assert snakegen.lint(path)[0].code == "too_large"
    assert math.isfinite(path.stat().st_size)
