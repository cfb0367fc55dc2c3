"""The checksum of a whole log, verified before rerun decodes it: its decoder may abort on damage.

A log carries the text ``=SHA256=`` and 64 hexadecimal digits, the SHA-256 of its bytes
with zeros in the digits' place. rerun compresses its chunks, but leaves a text that does not
repeat itself as it is.
"""

import hashlib
import mmap
import re
import secrets
from pathlib import Path
from threading import Event

from snakegen.errors import LogError

_MARK = "=SHA256="
_DIGITS = 64
_SEALED = re.compile(rb"=SHA256=([0-9a-f]{64})")


def placeholder() -> str:
    """Returns a text to log, whose digits `Sealed` replaces; another one at every call."""
    return _MARK + secrets.token_hex(_DIGITS // 2)


class Sealed:
    """Writes a file as it comes and puts its checksum in the place of a `placeholder` in it.

    Args:
        path: to write.
        text: the placeholder, among the first bytes.

    Attributes:
        found: set once the placeholder has come by.
    """

    def __init__(self, path: Path, text: str) -> None:
        self.found = Event()
        self._file = path.open("wb")
        self._text, self._head, self._at = text.encode(), b"", 0
        self._digest = hashlib.sha256()

    def write(self, data: bytes) -> None:
        """Appends bytes; those before the placeholder wait for it."""
        if not self.found.is_set():
            self._head += data
            at = self._head.find(self._text)
            if at < 0:
                return
            self._at = at + len(_MARK)
            data = self._head[: self._at] + b"0" * _DIGITS + self._head[self._at + _DIGITS :]
            self._head = b""
            self.found.set()
        self._digest.update(data)
        self._file.write(data)

    def close(self) -> None:
        """Writes the checksum and closes the file."""
        with self._file:
            if self.found.is_set():
                self._file.seek(self._at)
                self._file.write(self._digest.hexdigest().encode())


def is_sealed(path: Path) -> bool:
    """Verifies the checksum of a file; returns False where it has none.

    Raises:
        LogError: its bytes are not those that were written.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        found = _SEALED.search(content)
        if found is None:
            return False
        first, last = found.span(1)
        stated = found.group(1).decode()
        del found  # it holds the map
        digest = hashlib.sha256()
        for part in (content[:first], b"0" * _DIGITS):
            digest.update(part)
        for start in range(last, len(content), 1 << 20):
            digest.update(content[start : start + (1 << 20)])
    if digest.hexdigest() != stated:
        raise LogError(f"{path} is cut short or damaged: its checksum differs")
    return True
