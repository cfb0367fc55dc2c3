"""Missions, found by folder: one module each."""
