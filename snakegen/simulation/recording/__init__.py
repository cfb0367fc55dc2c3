"""What a run leaves: samples, metrics, verdict."""
