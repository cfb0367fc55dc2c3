"""Logs of verification runs: written to rerun, read back whole, shown, compared.

    write(recording, path)      one .rrd that opens ready to read
    read(path) -> Recording     everything back, bit for bit
    snapshot(path, png)         the picture of a log, as the viewer draws it
    compare(path_a, path_b)     two runs' metrics side by side

rerun is imported inside the functions alone: importing this package costs nothing.
"""

from snakegen.log.read import read
from snakegen.log.write import write

__all__ = ["read", "write"]
