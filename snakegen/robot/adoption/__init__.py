"""Modules of a stranger's robot, drafted from its URDF: rotors, gimbals, spins and limits."""
