"""From a spec or a URDF to a folder of files that agree."""
