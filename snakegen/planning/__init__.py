"""Motion planning through scenes: seeds, trajectories in time, certificates between waypoints."""
