"""What a person can mend: one class per cause, each with a message that names the remedy."""

from collections.abc import Iterable
from difflib import get_close_matches

SHOWN = 40  # names in a list of what is known


class SnakegenError(Exception):
    """Base of every error that a user can mend; the message says what, where and what works."""


class SpecError(SnakegenError):
    """A mistake in a robot spec, a preset name or an override."""


class DescriptionError(SnakegenError):
    """A URDF, MJCF or mesh that cannot be read or does not pass the lint."""


class PostureError(SnakegenError):
    """A joint name or value that the robot does not have or cannot reach."""


class AnalysisError(SnakegenError):
    """An analysis was asked for something that its input does not define."""


class MissionError(SnakegenError):
    """A verification run that cannot start, or a mission file with a mistake."""


class SceneError(SnakegenError):
    """A scene file with a mistake: an obstacle, a start or a goal that cannot be read."""


class PlanError(SnakegenError):
    """A scene without a way for the robot, or a start or goal that it cannot hold."""


class LogError(SnakegenError):
    """A recording that cannot be read or written."""


def near(name: str, known: Iterable[str], count: int = 3) -> str:
    """Returns ``" Did you mean 'a' or 'b'?"`` for the nearest of `known`, else a list of them."""
    known = list(known)
    close = get_close_matches(name, known, n=count, cutoff=0.6)
    if close:
        return f" Did you mean {' or '.join(repr(c) for c in close)}?"
    if not known:
        return ""
    shown = ", ".join(known[:SHOWN]) + (", …" if len(known) > SHOWN else "")
    return f" Known: {shown}."
