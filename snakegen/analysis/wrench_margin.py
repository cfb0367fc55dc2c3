"""How much wrench a robot has to spare round hover (THEORY A4)."""

from snakegen.margins.thrust import ThrustMargins, thrust_margins
from snakegen.margins.vectored import VectoredMargins, vectored_margins

__all__ = ["ThrustMargins", "VectoredMargins", "thrust_margins", "vectored_margins"]
