"""The one numba decorator: compiled on disk, keyed by a hash of every source a kernel rests on.

Numba keys its own cache by the file of the decorated function alone, so editing a callee in
another file leaves a stale result; here the folder's name carries a hash of the kernel's own file
and of all kernel files that it imports, and `kernel_cache` keeps the entries. Where no folder can
be written kernels compile in memory.
"""

import ast
import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import config

from snakegen.kernels.core.kernel_cache import KernelCache, note, prepare_folder

F = TypeVar("F", bound=Callable[..., Any])
numba_config: Any = config
_KERNELS = Path(__file__).parents[1]
_PACKAGE = "snakegen.kernels."


def _file(module: str) -> Path:
    """Returns the file of kernel module `module`, dotted below ``snakegen.kernels``."""
    return _KERNELS.joinpath(*module.split(".")).with_suffix(".py")


@cache
def _imports(module: str) -> frozenset[str]:
    """Returns the kernel modules that kernel module `module` imports."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(_file(module).read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(_PACKAGE):
            base = (node.module or "").removeprefix(_PACKAGE)
            names.update({base, *(f"{base}.{alias.name}" for alias in node.names)})
    return frozenset(name for name in names if _file(name).is_file())


def sources(module: str) -> list[Path]:
    """Returns the files on which kernel module `module` rests: itself and all that it imports."""
    reached, waiting = set(), [module]
    while waiting:
        name = waiting.pop()
        if name not in reached and _file(name).is_file():
            reached.add(name)
            waiting.extend(_imports(name))
    return sorted(_file(name) for name in reached)


@cache
def cache_folder(name: str) -> Path | None:
    """Returns the folder for the compiled kernels of module `name`; None where none is writable.

    Tried in order: ``$SNAKEGEN_CACHE_DIR``, ``$XDG_CACHE_HOME``, ``~/.cache``. A folder that
    another user owns or may write is not used: its entries are code.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sources(name):
        digest.update(source.relative_to(_KERNELS).as_posix().encode() + source.read_bytes())
    roots = (
        os.environ.get("SNAKEGEN_CACHE_DIR"),
        os.environ.get("XDG_CACHE_HOME"),
        os.path.expanduser("~/.cache"),
    )
    refused = ""
    for root in filter(None, roots):
        folder = Path(root) / "snakegen" / f"{name}-{digest.hexdigest()[:16]}"
        try:
            prepare_folder(folder, name)
            return folder
        except OSError as error:
            refused = f"{folder.parent}: {error.strerror or error}"
    note(f"kernel cache {refused or 'without a folder'}; compiling in memory")
    return None


def jit(function: F | None = None, /, **options: Any) -> Any:
    """Compiles `function` in nopython mode with the cache above; `options` go to `numba.njit`.

    ``error_model="numpy"`` unless asked otherwise: a division by zero gives inf or nan. Wrappers
    that nobody calls are left out, a sixth of the compile time: the one for C function pointers,
    and for a function of a leading underscore the one for Python; only kernels may call those.
    """
    if function is None:
        return lambda f: jit(f, **options)
    options.setdefault("error_model", "numpy")
    options.setdefault("_nrt", True)  # else that of whichever kernel calls it first, cached so
    options.setdefault("no_cfunc_wrapper", True)
    options.setdefault("no_cpython_wrapper", function.__name__.startswith("_"))
    folder = cache_folder(function.__module__.removeprefix(_PACKAGE))
    dispatcher = numba.njit(**options)(function)
    if folder and not numba_config.DISABLE_JIT:
        dispatcher._cache = KernelCache(function, folder)
    return dispatcher


def cold(*modules: str) -> bool:
    """Tells whether kernel modules, by default those of flights, have yet to be compiled."""
    folders = [cache_folder(name) for name in modules or ("flight.flight", "margins.vectored")]
    return any(f is None or not any(f.rglob("*.nbc")) for f in folders)
