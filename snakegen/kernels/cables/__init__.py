"""Cable tensions, compiled."""
