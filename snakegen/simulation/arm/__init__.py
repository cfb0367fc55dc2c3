"""An arm moved by its servos."""
