"""Control laws: pure functions from state to command."""
