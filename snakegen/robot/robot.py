"""Robot: a Pinocchio model and its modules, read from a URDF, the single source of truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import pinocchio as pin
from numpy.typing import ArrayLike

from snakegen.base import yaml_file
from snakegen.errors import DescriptionError, PostureError, SnakegenError, near
from snakegen.robot.arrays import configuration_of
from snakegen.robot.bodies import GRAVITY, RobotBodies
from snakegen.robot.configuration import Configuration
from snakegen.robot.floating_root import without_floating_root
from snakegen.robot.force_sets import force_sets_at, force_shapes
from snakegen.robot.frames import links_in_a_row, root_link_of
from snakegen.robot.modules import Modules, from_urdf
from snakegen.robot.modules_file import from_data, with_servos
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.stream_losses import with_stream_losses
from snakegen.wrench_margins.force_sets import ForceSets

__all__ = ["GRAVITY", "Robot", "load"]


@dataclass(frozen=True, eq=False)
class Robot(RobotBodies):
    """A robot as analyses see it.

    Attributes:
        name: the URDF's robot name.
        urdf: the URDF text.
        path: where the URDF stands, None for one that was made in memory.
        modules: rotors, servos, gains: what URDF cannot say.
        model: Pinocchio model, armature included; the root is a free-flyer if floating.
    """

    @cached_property
    def force_shapes(self) -> ForceSets:
        """What its apparatuses can push with, in any posture."""
        return force_shapes(self)

    def force_sets(self, q: ArrayLike) -> ForceSets:
        """Returns what its apparatuses can push with at q: points and axes about the CoG.

        Ranges are the gimbal joints' limits; points are those of q's gimbal angles. Gimbals
        whose thrusts are of no known form raise a DescriptionError.
        """
        return force_sets_at(self, self.validate_configuration(q))

    def configuration(
        self,
        posture: Mapping[str, float] | None = None,
        *,
        base_rpy: Sequence[float] = (0.0, 0.0, 0.0),
        base_position: Sequence[float] = (0.0, 0.0, 0.0),
        gimbals: Literal["given", "hover"] = "given",
    ) -> Configuration:
        """Returns q of a posture given by joint names; joints not named are at 0.

        Args:
            posture: rad (m where a joint slides) by joint name; may hold ``base_rpy`` and
                ``base_position`` too, as posture files do.
            base_rpy: rad, attitude of the root link; floating base only.
            base_position: m.
            gimbals: ``hover`` turns them so that every apparatus' thrust points up, or as near to
                it as limits allow; ``given`` leaves them at the posture's angles.

        Raises:
            PostureError: an unknown name (with the near ones), no number, or out of limits.
        """
        given = {} if posture is None else posture
        q = configuration_of(self, given, base_rpy, base_position)
        if gimbals == "given":
            return q
        if gimbals != "hover":
            raise PostureError(f"gimbals is {gimbals!r}; it must be 'given' or 'hover'.")
        return hover_gimbals(self, q)

    def __repr__(self) -> str:
        """Returns its name and how many of each part it has."""
        joints, modules = len(self.joint_names), self.modules
        parts = [
            f"{joints} joint{'s' * (joints != 1)}",
            f"{len(modules.apparatuses)} apparatuses" if modules.apparatuses else "",
            f"{len(modules.screws)} screw units" if modules.screws else "",
            "floating base" if self.floating else "fixed base",
            f"{self.mass:.3g} kg",
        ]
        return f"Robot({self.name}: {', '.join(p for p in parts if p)})"


_DEEPEST = 3000  # links in a row: at 4,000 Pinocchio's recursion leaves a stack of 8 MB

ModulesSource = str | Path | Mapping[str, Any]


def load(source: Any, *, modules: ModulesSource | None = None) -> Robot:
    """Reads a robot from a preset name, a spec file or RobotSpec, or a URDF file.

    Args:
        source: what to read; a path that ends in .urdf is a URDF, and so is a file of XML.
        modules: a modules file for a URDF that snakegen did not write, or what it holds.

    Raises:
        SnakegenError: one line that says what is wrong, where, and what would have worked.
    """
    from snakegen.spec.urdf import is_description, read_urdf, urdf_text

    if isinstance(source, str | Path) and is_description(source):
        path = Path(source)
        return from_urdf_text(read_urdf(path), path, modules=modules)
    if modules is not None:
        raise SnakegenError("--modules goes with a URDF; a spec already names its modules.")
    return from_urdf_text(urdf_text(source), None)


def from_urdf_text(
    text: str,
    path: Path | None,
    *,
    modules: ModulesSource | None = None,
    checked: bool = False,
) -> Robot:
    """Reads a robot from URDF text that stands, or would stand, at `path`.

    Args:
        text: URDF text.
        path: where its meshes are looked for, None to leave them out.
        modules: a modules file or its data, for text without a <snakegen> element.
        checked: the lint has passed it already.
    """
    from snakegen.linter import lint

    if not checked:
        lint.check(path if path is not None else text)
    lint.refuse_mjcf(text, str(path or "URDF"))
    text, world = without_floating_root(text)
    found = from_urdf(text)
    if modules is not None:
        found = with_servos(_read_modules(modules, root_link_of(text), world), text)
    found = Modules(floating=False) if found is None else found
    _refuse_depth(text, path)
    if world is not None:
        found = replace(found, floating=True)
    try:
        root = (pin.JointModelFreeFlyer(),) if found.floating else ()
        model = pin.buildModelFromXML(text, *root)
    except (ValueError, RuntimeError) as error:
        raise DescriptionError(f"{path or 'URDF'}: Pinocchio cannot read it ({error}).") from None
    for what, parts in (("servo", found.servos), ("screw drive", found.screws)):
        for part in parts:
            if not model.existJointName(part.joint):
                raise DescriptionError(
                    f"{what} on joint '{part.joint}', which does not exist."
                    f"{near(part.joint, list(model.names)[1:])}"
                )
            model.armature[model.joints[model.getJointId(part.joint)].idx_v] = part.armature
    robot = Robot(str(model.name), text, path, found, model)
    _ = robot.tree, robot.rotors, robot.gimbals  # a wrong name is an error now, not later
    return replace(robot, modules=with_stream_losses(found, robot.rotors))


def _refuse_depth(text: str, path: Path | None) -> None:
    """Refuses chains at which Pinocchio, which reads them by recursion, would crash.

    Raises:
        DescriptionError: more than `_DEEPEST` links in a row.
    """
    if text.count("<joint") <= _DEEPEST:
        return
    depth = links_in_a_row(text)
    if depth > _DEEPEST:
        raise DescriptionError(
            f"{path or 'URDF'}: {depth} links in a row; Pinocchio reads up to {_DEEPEST}."
        )


def _read_modules(modules: ModulesSource, root: str, world: str | None) -> Modules:
    """Reads modules for a root link, which may be named by the link above its floating joint."""
    if isinstance(modules, Mapping):
        data, place = dict(modules), "modules"
    else:
        data, place = yaml_file.read(Path(modules)), Path(modules).name
    if isinstance(data, dict) and world is not None and data.get("floating_root") == world:
        data = data | {"floating_root": root}
    return from_data(data, place, root)
