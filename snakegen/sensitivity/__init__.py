"""Derivatives of what analyses compute, by joints, attitude, masses and the spec's fields."""
