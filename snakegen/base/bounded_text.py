"""Text of files of unknown origin: regular files, and no more than so many bytes."""

import errno
import os
import stat
from pathlib import Path

_KINDS = (
    (stat.S_ISCHR, "Is a device, not a file"),
    (stat.S_ISBLK, "Is a device, not a file"),
    (stat.S_ISSOCK, "Is a socket, not a file"),
)


def refuse_special(path: Path) -> None:
    """Raises where `path` is no regular file: opening or reading it might never end.

    A pipe that a shell made for a command (``<(xacro …)``, ``/dev/stdin``) has a writer and passes;
    one with a name in a folder may have none. A folder passes: to open it says so at once.

    Raises:
        OSError: a named pipe, a device, a socket, or nothing there.
    """
    mode = path.stat().st_mode
    for is_kind, words in _KINDS:
        if is_kind(mode):
            raise OSError(errno.EINVAL, words, str(path))
    if stat.S_ISFIFO(mode) and os.path.lexists(os.path.realpath(path)):
        raise OSError(errno.EINVAL, "Is a named pipe, not a file", str(path))


def what_is_there(path: Path) -> str:
    """Returns, for an error, what stands where a file should: ``no such file`` or what it is."""
    try:
        refuse_special(path)
    except FileNotFoundError:
        return "no such file"
    except OSError as error:
        words = error.strerror or str(error)
        return words[:1].lower() + words[1:]
    if path.is_dir():
        return "is a folder"
    return "is there" if path.is_file() else "is a pipe, which is read only once"


def read_bytes(path: Path, most: int) -> bytes:
    """Returns the bytes of a file, or of a pipe that a shell made.

    Args:
        path: the file.
        most: bytes that are read.

    Raises:
        OSError: it cannot be opened, is a named pipe or a device (which may have no end), or is
            longer.
    """
    refuse_special(path)
    with path.open("rb") as stream:
        data = stream.read(most + 1)
    if len(data) > most:
        raise OSError(errno.EFBIG, f"More than {most / 1e6:g} MB", str(path))
    return data


def read_bounded(path: Path, most: int) -> str:
    """Returns the UTF-8 text of a file, or of a pipe that a shell made.

    Raises:
        OSError: as `read_bytes`.
        UnicodeDecodeError: its bytes are no UTF-8.
    """
    text = read_bytes(path, most).decode("utf-8")
    return text.replace("\r\n", "\n").replace("\r", "\n")
