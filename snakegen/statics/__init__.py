"""Joint torques of a robot: the law, its support in hover, its tip, its worst posture."""
