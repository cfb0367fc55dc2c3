"""snakegen: one short file to a verified snake robot (see README.md).

The public surface loads lazily, so that ``import snakegen`` costs nothing.
"""

from __future__ import annotations

TYPE_CHECKING = False  # typing itself takes long enough to import for a Ctrl-C to meet it

__version__ = "0.1.0"
__all__ = [
    "Configuration",
    "PostureMargins",
    "Robot",
    "RobotSpec",
    "SimulatedRecording",
    "SnakegenError",
    "adopt",
    "build",
    "compare",
    "convert",
    "lint",
    "load",
    "margin_gradient",
    "margins",
    "simulate",
]

if TYPE_CHECKING:
    from typing import Any

    from snakegen.analysis.posture_margins import PostureMargins, margins
    from snakegen.errors import SnakegenError
    from snakegen.linter.lint import lint
    from snakegen.log.simulate import SimulatedRecording, simulate
    from snakegen.pipeline.build import build
    from snakegen.pipeline.compare import compare
    from snakegen.pipeline.convert import convert
    from snakegen.robot.adoption.adopt import adopt
    from snakegen.robot.configuration import Configuration
    from snakegen.robot.robot import Robot, load
    from snakegen.sensitivity.margin_gradient import margin_gradient
    from snakegen.spec.robot_spec import RobotSpec

_HOME = {
    "adopt": "snakegen.robot.adoption.adopt",
    "build": "snakegen.pipeline.build",
    "compare": "snakegen.pipeline.compare",
    "convert": "snakegen.pipeline.convert",
    "lint": "snakegen.linter.lint",
    "margins": "snakegen.analysis.posture_margins",
    "load": "snakegen.robot.robot",
    "margin_gradient": "snakegen.sensitivity.margin_gradient",
    "simulate": "snakegen.log.simulate",
    "SimulatedRecording": "snakegen.log.simulate",
    "Configuration": "snakegen.robot.configuration",
    "PostureMargins": "snakegen.analysis.posture_margins",
    "Robot": "snakegen.robot.robot",
    "RobotSpec": "snakegen.spec.robot_spec",
    "SnakegenError": "snakegen.errors",
}


def __getattr__(name: str) -> Any:
    """Imports a public name from its module at first use (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module 'snakegen' has no attribute {name!r}")
    import importlib

    value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Lists what there is to use, loaded or not."""
    return sorted({*__all__, "__version__", "__doc__"})


def _register() -> None:
    """Registers the environment where Gymnasium is imported already."""
    import sys

    if "gymnasium" in sys.modules:
        import snakegen.environment  # noqa: F401  (importing it registers)


_register()
del _register
