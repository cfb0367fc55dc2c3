"""Verification runs: one stepping loop, missions, disturbances, metrics, verdict."""
