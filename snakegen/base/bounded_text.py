"""Text of files of unknown origin: no device, and no more than so many bytes."""

import errno
import stat
from pathlib import Path


def read_bounded(path: Path, most: int) -> str:
    """Returns the UTF-8 text of a file or pipe.

    Args:
        path: the file.
        most: bytes that are read.

    Raises:
        OSError: it cannot be opened, is a device (which may have no end), or is longer.
        UnicodeDecodeError: its bytes are no UTF-8.
    """
    with path.open("rb") as stream:
        kind = path.stat().st_mode
        if stat.S_ISCHR(kind) or stat.S_ISBLK(kind):
            raise OSError(errno.EINVAL, "Is a device", str(path))
        data = stream.read(most + 1)
    if len(data) > most:
        raise OSError(errno.EFBIG, f"More than {most / 1e6:g} MB", str(path))
    return data.decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")
