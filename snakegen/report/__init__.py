"""Pages and charts of the analyses."""
