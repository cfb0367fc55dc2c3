"""File names made of names that strangers chose."""

import re

_LONGEST = 100  # characters of a name: file systems take 255 bytes, and suffixes follow


def file_stem(name: str) -> str:
    """Returns a name for files: letters, digits, ``_``, ``-`` and ``.`` stay, the rest is ``_``.

    A name that would leave its folder or begin with a dot, as ``../x`` does, stays within it.
    """
    stem = re.sub(r"[^\w.-]", "_", name).strip(".")[:_LONGEST].rstrip(".")
    return stem or "robot"
