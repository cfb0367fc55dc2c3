"""Motions: paths of the tip, paths of the body, torques along them."""
