"""Control laws of a tick, compiled."""
