"""Feasible-wrench margins on plain arrays (THEORY A4): usable for any robot, without `Robot`."""
