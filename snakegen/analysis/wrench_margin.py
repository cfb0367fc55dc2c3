"""How much wrench a robot has to spare round hover (THEORY A4)."""

from snakegen.margins.thrust import ThrustMargins, thrust_margins

__all__ = ["ThrustMargins", "thrust_margins"]
