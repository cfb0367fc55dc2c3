"""Meshes and solids of a robot's parts."""
