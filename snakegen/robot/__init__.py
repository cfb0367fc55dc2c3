"""A robot as analyses read it: Pinocchio model, modules, configuration."""
