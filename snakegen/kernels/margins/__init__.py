"""Facets, supports and searches of margins, compiled."""
