"""One self-contained page of a robot: 3-D body with joint sliders, charts, tables, no network."""
