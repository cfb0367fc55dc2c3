"""Screw-drive constraints, compiled."""
