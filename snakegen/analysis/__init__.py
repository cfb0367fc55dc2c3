"""Analyses, found by folder: each module has `applies` and `analyze`, or is plain-array maths."""
