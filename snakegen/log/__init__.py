"""Logs of verification runs: written to rerun, read back whole, shown, compared.

    write(recording, path)      one .rrd that opens ready to read
    read(path) -> Recording     everything back, bit for bit
    inspect(path)               metrics and verdict computed again from the samples
    snapshot(path, png)         the picture of a log, as the viewer draws it
    view(path)                  rerun's viewer, on 127.0.0.1 alone
    compare(path_a, path_b)     two runs' metrics side by side

rerun is imported inside the functions alone: importing this package costs nothing.
"""

from snakegen.log.compare import Inspection, Row, compare, inspect
from snakegen.log.journal import Journal, journal_of
from snakegen.log.picture import snapshot, view
from snakegen.log.read import read
from snakegen.log.write import write

__all__ = [
    "Inspection",
    "Journal",
    "Row",
    "compare",
    "inspect",
    "journal_of",
    "read",
    "snapshot",
    "view",
    "write",
]
