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

from snakegen.errors import LogError

_MARK = "=SHA256="
_DIGITS = 64
_SEALED = re.compile(rb"=SHA256=([0-9a-f]{64})")


def placeholder() -> str:
    """Returns a text to log, whose digits `seal` replaces; another one at every call."""
    return _MARK + secrets.token_hex(_DIGITS // 2)


def seal(content: bytes, text: str) -> bytearray | None:
    """Returns `content` with its checksum in the place of `text`; None where it was compressed."""
    if content.count(text.encode()) != 1:
        return None
    at = content.index(text.encode()) + len(_MARK)
    sealed = bytearray(content)
    sealed[at : at + _DIGITS] = b"0" * _DIGITS
    sealed[at : at + _DIGITS] = hashlib.sha256(sealed).hexdigest().encode()
    return sealed


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
