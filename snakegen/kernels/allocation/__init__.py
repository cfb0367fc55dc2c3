"""Wrench maps and control allocation, compiled."""
