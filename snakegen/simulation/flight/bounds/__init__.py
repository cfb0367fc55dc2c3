"""What the errors of a flight are expected to be, by which its verdict judges it."""
