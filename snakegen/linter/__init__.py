"""Findings on URDF and MJCF text."""
