"""Scenes: obstacles, start, goal and demands of a motion, read from YAML."""
