"""Kinematics of screw-drive snakes (HA)."""
