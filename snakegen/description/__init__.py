"""Build: run xacro, lint, derive the MJCF, prove that both agree."""
