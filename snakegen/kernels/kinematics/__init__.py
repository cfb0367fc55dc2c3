"""Chains, Jacobians and inverse kinematics, compiled."""
