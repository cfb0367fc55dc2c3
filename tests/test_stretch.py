"""Another number of links: what a list refuses at once, and the remedy that its message gives."""

import re
import shlex

import pytest

from snakegen.errors import SpecError
from snakegen.spec.loading import load_spec


@pytest.mark.parametrize("links", [2, 5, 9, 40])
@pytest.mark.parametrize("name", ["arm6", "grasper3", "dragon3"])
def test_the_remedy_in_the_message_works(name, links):
    before = load_spec(name)
    with pytest.raises(SpecError, match="one value for all would do") as caught:
        load_spec(name, links=links)
    message = str(caught.value)
    assert "\n" not in message
    words = shlex.split(message[message.index("--set") :])
    assert words[::2] == ["--set"] * (len(words) // 2)
    spec = load_spec(name, links=links, overrides=words[1::2])
    assert spec.chain.links == links
    resolved = spec.resolved()
    assert len(resolved["chain"]["length"]) == links
    assert len(resolved["joint"]["axes"]) == links - 1
    # The value offered is one of the robot's own.
    assert resolved["chain"]["length"][0] in before.resolved()["chain"]["length"]


def test_the_message_names_all_lists_at_once():
    with pytest.raises(SpecError) as caught:
        load_spec("arm6", links=9)
    message = str(caught.value)
    assert "chain.length: 7 entries for 9 links (so have chain.mass, chain.inertia and" in message
    assert re.search(r"--set chain.mass=0.836041 .*--set 'joint.axes=\[pitch, yaw\]'", message)
    with pytest.raises(SpecError, match=r"chain.mass: 7 entries for 9 links \(so have"):
        load_spec("arm6", links=9, overrides=["chain.length=0.218"])


def test_single_values_stretch_and_the_same_number_stays():
    assert load_spec("dragon4", links=7).chain.links == 7
    assert load_spec("arm6", links=7) == load_spec("arm6")
    right = [0.2] * 9
    spec = load_spec(
        "arm6",
        links=9,
        overrides=[f"chain.length={right}", "chain.mass=1", "chain.inertia=null",
                   "joint.axes=[pitch, yaw]"],
    )  # fmt: skip
    assert spec.chain.length == right
