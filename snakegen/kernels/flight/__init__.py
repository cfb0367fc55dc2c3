"""The flight loop, compiled."""
