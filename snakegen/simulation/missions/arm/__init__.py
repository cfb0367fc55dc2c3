"""Missions of arms."""
