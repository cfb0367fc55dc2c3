"""Missions of robots that drive."""
