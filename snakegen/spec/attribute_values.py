"""What the attributes of the <snakegen> element may hold; each check says what is needed."""

from collections.abc import Callable
from math import isfinite

from snakegen.spec.wheel_layout import ROLLERS

POSES = ("stand", "wall", "ceiling", "vertical", "any")  # of a fixed base
Check = Callable[[str], None]  # raises ValueError that says what is needed


def number(text: str, low: float = float("-inf"), *, strict: bool = False) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ValueError("a number is needed") from None
    if not isfinite(value):
        raise ValueError("a finite number is needed")
    if value < low or (strict and value == low):
        raise ValueError(f"more than {low:g} is needed" if strict else f"{low:g} or more is needed")
    return value


def real(text: str) -> None:
    number(text)


def positive(text: str) -> None:
    number(text, 0.0, strict=True)


def not_negative(text: str) -> None:
    number(text, 0.0)


def limit(text: str) -> None:
    if text != "inf":
        positive(text)


def share(text: str) -> None:
    if not 0.0 <= number(text) <= 1.0:
        raise ValueError("a share from 0 to 1 is needed")


def count(text: str) -> None:
    if number(text) not in range(1, 65):
        raise ValueError("a whole number from 1 to 64 is needed")


def spin(text: str) -> None:
    if number(text) not in (-1.0, 0.0, 1.0):
        raise ValueError("1, -1 or 0 is needed")


def switch(text: str) -> None:
    if text not in ("0", "1"):
        raise ValueError("0 or 1 is needed")


def axis(text: str) -> None:
    numbers = [number(part) for part in text.split()]
    if len(numbers) != 3 or not any(numbers):
        raise ValueError("three numbers, not all 0, are needed, as in '0 0 1'")


def point(text: str) -> None:
    if len([number(part) for part in text.split()]) != 3:
        raise ValueError("three numbers are needed, as in '0.2 0 0'")


def name(text: str) -> None:
    if not text.strip():
        raise ValueError("a name is needed")


def rollers(text: str) -> None:
    if text not in ROLLERS:
        raise ValueError(f"one of {', '.join(ROLLERS)} is needed")


def pose(text: str) -> None:
    if text not in POSES:
        raise ValueError(f"one of {', '.join(POSES)} is needed")


def anything(text: str) -> None:
    """Accepts what a model of the spec checks as a whole."""
