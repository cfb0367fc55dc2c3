"""A drive on passive wheels: plants, gait, metrics."""
