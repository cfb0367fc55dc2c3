"""The self-contained pages: what they hold, that they ask for nothing, and that a browser draws."""

import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import snakegen
from snakegen.cli import cli
from snakegen.log.skeleton import skeleton
from snakegen.report.collection import Page
from snakegen.web.body import body_glb, body_joints, body_links, boxes
from snakegen.web.page import write_robot_page

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("chrome")


class _References(HTMLParser):
    """Collects what a page would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [v for k, v in attrs if k in ("src", "href", "srcset", "data") and v]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of dragon4 with the two cheapest analyses."""
    from snakegen.analysis import hover, mass

    robot = snakegen.load("generated/dragon4/dragon4.urdf")
    q = np.asarray(robot.configuration({"joint1_yaw": 0.7}))
    results = {"mass": mass.analyze(robot, q), "hover": hover.analyze(robot, q)}
    path = tmp_path_factory.mktemp("page") / "dragon4.html"
    write_robot_page(Page(robot, q, results), path, robot.folder, "snakegen analyze <dragon4>")
    return path


def _data(path: Path) -> dict:
    text = path.read_text(encoding="utf-8")
    start = text.index("const PAGE = ") + len("const PAGE = ")
    found, _ = json.JSONDecoder().raw_decode(text[start:])
    return dict(found)


def test_the_page_is_one_file_that_asks_for_nothing(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    references = _References()
    references.feed(re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL))
    assert references.found and all(r.startswith("data:") for r in references.found)
    assert "default-src 'none'" in text
    assert page.stat().st_size < 10e6
    assert [p.name for p in page.parent.iterdir()] == [page.name]


def test_the_page_holds_the_body_the_posture_and_the_thrusts(page: Path) -> None:
    data = _data(page)
    assert data["angles"]["joint1_yaw"] == pytest.approx(0.7)
    assert data["links"][0] == "link1" and len(data["rotors"]) == 8
    assert sum(data["thrust"]) == pytest.approx(8.0 * 9.81, rel=1e-6)
    assert sum(m["mass"] for m in data["masses"]) == pytest.approx(8.0)
    assert "snakegen analyze &lt;dragon4&gt;" in page.read_text(encoding="utf-8")


def test_joints_of_the_page_give_the_poses_of_pinocchio() -> None:
    import pinocchio as pin

    robot = snakegen.load("dragon4")
    q = np.asarray(robot.configuration({"joint1_yaw": 0.4, "joint2_pitch": -0.3}))
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, q)
    links = body_links(robot.urdf)
    angles = {"joint1_yaw": 0.4, "joint2_pitch": -0.3}
    pose = {0: np.eye(4)}
    for joint in body_joints(robot.urdf):  # as the page's script turns them
        motion = np.eye(4)
        motion[:3, :3] = pin.exp3(np.array(joint["axis"]) * angles.get(joint["name"], 0.0))
        frame = np.array(joint["origin"]).reshape(4, 4).T
        pose[joint["child"]] = pose[joint["parent"]] @ frame @ motion
    for i, name in enumerate(links):
        right = data.oMf[model.getFrameId(name)].homogeneous
        np.testing.assert_allclose(pose[i], right, atol=1e-8)


def test_the_body_has_a_node_for_each_visual_that_a_urdf_has() -> None:
    urdf = Path("generated/dragon4/dragon4.urdf").read_text(encoding="utf-8")
    glb = body_glb(urdf, Path("generated/dragon4"))
    nodes = set(re.findall(rb'"name":"(L\d+_\d+)"', glb))
    assert len(nodes) == urdf.count("<visual")
    assert body_glb("<robot name='bare'><link name='a'/></robot>", None) == b""


def test_a_mimic_joint_follows_and_limits_bound_the_slider() -> None:
    urdf = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
      <joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
        <limit lower="-0.5" upper="1.5" effort="1" velocity="1"/></joint>
      <joint name="k" type="revolute"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/>
        <mimic joint="j" multiplier="-2" offset="0.1"/></joint></robot>"""
    first, second = body_joints(urdf)
    assert (first["low"], first["high"]) == (-0.5, 1.5)
    assert (second["follows"], second["ratio"], second["offset"]) == ("j", -2.0, 0.1)
    assert [j.name for j in skeleton(urdf).joints] == ["j", "k"]


def test_boxes_of_a_log_stand_in_its_page() -> None:
    turned = {"name": "a", "centre": [1, 2, 3], "half": [0.5, 1, 2], "roll": np.pi / 2}
    placed = {"name": "b", "centre": [0, 0, 0], "half": [1, 1, 1], "rotation": np.eye(3).tolist()}
    first, second = boxes([turned, placed, {"name": "c", "kind": "cylinder", "centre": [0, 0, 0]}])
    assert first["size"] == [1.0, 2.0, 4.0] and first["at"] == [1, 2, 3]
    np.testing.assert_allclose(first["xyzw"], [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    np.testing.assert_allclose(second["xyzw"], [0, 0, 0, 1])


def test_another_ending_is_refused_before_anything_runs(tmp_path: Path) -> None:
    run = CliRunner().invoke(cli, ["analyze", "dragon4", "--report", str(tmp_path / "a.pdf")])
    assert run.exit_code == 1 and ".html" in str(run.exception)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
@pytest.mark.parametrize(("options", "ready"), [((), True), (("--disable-3d-apis",), False)])
def test_a_browser_shows_the_body_or_the_picture(
    page: Path, options: tuple[str, ...], ready: bool
) -> None:
    command = [
        str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader", *options, "--virtual-time-budget=6000", "--dump-dom",
        page.resolve().as_uri(),
    ]  # fmt: skip
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert ('data-ready="3d"' in run.stdout) is ready
    assert ('id="still"' in run.stdout) is not ready
    assert "joint3_yaw" in run.stdout
    assert "Uncaught" not in run.stderr and "Content Security Policy" not in run.stderr
