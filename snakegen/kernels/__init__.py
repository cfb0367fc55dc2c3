"""Compiled loops on plain arrays: no snakegen types, no validation, no I/O."""
