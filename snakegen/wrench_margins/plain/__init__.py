"""Margins of one posture in NumPy: the mathematics as it is read, and the oracle of its kernels."""
