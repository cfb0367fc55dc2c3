"""A flight in MuJoCo: plant, controller loop, trim."""
