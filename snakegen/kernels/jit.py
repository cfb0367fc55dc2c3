"""The one numba decorator: cached on disk, keyed by a hash of all kernel sources.

Numba keys its own cache by the file of the decorated function alone, so editing a callee in
another file leaves a stale result; here the folder's name carries a hash of every kernel file.
Where no folder can be written the kernels compile in memory.
"""

import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import config as numba_config

F = TypeVar("F", bound=Callable[..., Any])


@cache
def cache_folder() -> Path | None:
    """Returns the folder for compiled kernels, or None where none can be written."""
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.name.encode() + source.read_bytes())
    roots = [
        os.environ.get("SNAKEGEN_CACHE_DIR"),
        os.environ.get("XDG_CACHE_HOME"),
        os.path.expanduser("~/.cache"),
    ]
    for root in filter(None, roots):
        folder = Path(root) / "snakegen" / f"kernels-{digest.hexdigest()[:16]}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
        except OSError:
            continue
    return None


def jit(function: F | None = None, /, **options: Any) -> Any:
    """Compiles `function` in nopython mode with the cache above; `options` go to `numba.njit`.

    ``error_model="numpy"`` unless asked otherwise: a division by zero gives inf or nan.
    """
    if function is None:
        return lambda f: jit(f, **options)
    options.setdefault("error_model", "numpy")
    folder = cache_folder()
    before = numba_config.CACHE_DIR
    numba_config.CACHE_DIR = str(folder) if folder else before
    try:
        return numba.njit(cache=folder is not None, **options)(function)
    finally:
        numba_config.CACHE_DIR = before
