"""Small shared parts: files, YAML, memory, rotations."""
