"""Closer bounds of one posture where sets are not convex, by branching."""
