"""The YAML grammar of a robot: chain, modules, control, plant."""
