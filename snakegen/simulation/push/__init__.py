"""How far a robot can be pushed: predictions and the loaded equilibrium."""
