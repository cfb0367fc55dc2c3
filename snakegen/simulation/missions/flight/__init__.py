"""Missions of robots that fly."""
