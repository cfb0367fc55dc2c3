"""From a URDF to an MJCF: a file per element."""
