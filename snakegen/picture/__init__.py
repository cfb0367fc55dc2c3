"""A robot drawn, by MuJoCo or matplotlib."""
