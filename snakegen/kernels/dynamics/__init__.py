"""Inverse dynamics and joint torques, compiled."""
