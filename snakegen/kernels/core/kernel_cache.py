"""Compiled kernels on disk: one checksummed file a signature, found by content, never fatal.

Numba's own cache keys entries by the path and time of the source, numbers them in an index that
concurrent processes overwrite, and loads damaged machine code. Here the folder carries a hash of
the sources, the file name a hash of signature, processor and byte code, and a file whose checksum
does not match is removed and compiled again. A full or unwritable disk costs a note, once.
"""

import errno
import hashlib
import os
import pickle
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator

_CHECKSUM = 32  # bytes of SHA-256 in front of each entry
_ADDRESS = re.compile(r" at 0x[0-9a-f]+")
_MONTH = 30 * 86400.0  # s
_KEPT = 24  # folders of a kernel module: versions of snakegen and working copies side by side
_noted: set[str] = set()  # one note a process


def prepare_folder(folder: Path, name: str) -> None:
    """Makes the folder of a kernel module's entries and marks it as used today.

    A new one is the occasion to remove those of earlier sources of the module: all that were not
    used for a month, and the longest unused beyond `_KEPT`.

    Raises:
        OSError: it cannot be made or written, or others than this user may write it.
    """
    new = not folder.is_dir()
    folder.mkdir(parents=True, exist_ok=True)
    for path in (folder, folder.parent):
        state = path.stat()
        foreign = hasattr(os, "getuid") and state.st_uid != os.getuid()
        if foreign or state.st_mode & stat.S_IWOTH:
            raise PermissionError(errno.EPERM, "others than this user may write it")
    with tempfile.TemporaryFile(dir=folder):
        os.utime(folder)
    if new:
        remove_unused(folder.parent, name, keep=folder)


def remove_unused(root: Path, name: str, keep: Path) -> None:
    """Removes folders of module `name` that were not used for a month or are too many."""
    now, ages = time.time(), []
    for path in root.glob(f"{name}-{'[0-9a-f]' * 16}"):
        try:
            ages.append((now - path.stat().st_mtime, path))
        except OSError:
            continue
    for rank, (age, path) in enumerate(sorted(ages)):
        if path != keep and (age > _MONTH or rank >= _KEPT):
            shutil.rmtree(path, ignore_errors=True)  # whoever uses it compiles again


class _Locator(_CacheLocator):
    """Gives numba the folder of a function's entries, whatever the path of its source."""

    def __init__(self, folder: Path, py_func: Callable[..., Any]) -> None:
        self._folder = str(folder)
        self._py_file = py_func.__code__.co_filename

    def get_cache_path(self) -> str:
        return self._folder

    def get_source_stamp(self) -> str:
        return ""  # the folder's name is the stamp

    def get_disambiguator(self) -> str:
        return ""


class Entries:
    """The files of one function: `load` returns None and `save` does nothing where it cannot."""

    def __init__(self, folder: Path, name: str) -> None:
        self._folder, self._name = folder, name

    def path(self, key: tuple[Any, ...]) -> Path:
        """Returns the file of `key` (signature, target processor, hashes of the byte code)."""
        text = _ADDRESS.sub("", "\n".join(str(part) for part in key))
        return self._folder / f"{self._name}-{hashlib.sha256(text.encode()).hexdigest()[:24]}.nbc"

    def load(self, key: tuple[Any, ...]) -> Any:
        """Returns what `save` was given; None if there is no such entry or it is damaged."""
        path = self.path(key)
        try:
            content = path.read_bytes()
        except OSError:
            return None
        checksum, payload = content[:_CHECKSUM], content[_CHECKSUM:]
        try:
            if hashlib.sha256(payload).digest() != checksum:
                raise ValueError("checksum differs")
            return pickle.loads(payload)
        except Exception:  # whatever a foreign or damaged file raises, it is compiled again
            self.drop(path)
            return None

    def save(self, key: tuple[Any, ...], data: Any) -> None:
        """Writes `data` beside its place, then renames it; a note on stderr where that fails."""
        path, payload = self.path(key), pickle.dumps(data, protocol=pickle.HIGHEST_PROTOCOL)
        temporary = ""
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            handle, temporary = tempfile.mkstemp(dir=self._folder, prefix=path.stem, suffix=".part")
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(payload).digest() + payload)
            os.replace(temporary, path)
        except OSError as error:
            if temporary:
                self.drop(Path(temporary))
            note(f"kernel cache {self._folder.parent}: {error.strerror}; compiling in memory")

    def drop(self, path: Path) -> None:
        """Removes a file if that can be done."""
        try:
            path.unlink(missing_ok=True)
        except OSError:
            note(f"kernel cache {self._folder.parent}: damaged entry {path.name} cannot be removed")

    def flush(self) -> None:
        """Removes every entry of the function."""
        for path in self._folder.glob(f"{self._name}-*.nbc"):
            self.drop(path)


class KernelCache(FunctionCache):
    """Numba's cache of one function over `Entries`; what cannot be rebuilt is compiled again."""

    _cache_file: Any  # Entries instead of numba's index and numbered files

    def __init__(self, py_func: Callable[..., Any], folder: Path) -> None:
        self._name, self._py_func = repr(py_func), py_func
        self._cache_path = str(folder)
        self._impl = CompileResultCacheImpl.__new__(CompileResultCacheImpl)
        self._impl._lineno = py_func.__code__.co_firstlineno
        self._impl._locator = _Locator(folder, py_func)
        self._cache_file = Entries(folder, py_func.__qualname__.replace("<", "").replace(">", ""))
        self.enable()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Returns the compiled function of `sig`; None where it must be compiled."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # an entry of a numba that pickles otherwise
            self._cache_file.drop(
                self._cache_file.path(self._index_key(sig, target_context.codegen()))
            )
            return None


def note(text: str) -> None:
    """Prints one note a process on stderr."""
    if not _noted:
        _noted.add(text)
        print(f"note: {text}", file=sys.stderr)
