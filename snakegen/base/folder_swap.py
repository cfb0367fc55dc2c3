"""A finished work folder put in the place of another: by one exchange of names, or file by file."""

import ctypes
import os
import shutil
from itertools import islice
from pathlib import Path

_HERE = -100  # AT_FDCWD
_EXCHANGE = 2  # RENAME_EXCHANGE
_OWN = 5000  # entries of a folder that is still carried over


def must_stay(folder: Path) -> bool:
    """Tells whether a folder cannot be exchanged for another of the same name.

    The current folder or one above it (a shell would go on in the old one), a mount point, a
    folder whose parent cannot be written, one that holds links, which lead to the files meant,
    and one with so much else in it that it is no build's own.
    """
    if (
        Path.cwd().is_relative_to(folder)
        or os.path.ismount(folder)
        or not os.access(folder.parent, os.W_OK | os.X_OK)
    ):
        return True
    entries = list(islice(folder.rglob("*"), _OWN + 1))
    return len(entries) > _OWN or any(path.is_symlink() for path in entries)


def move_files(new: Path, folder: Path) -> None:
    """Renames every file of the tree `new` to its place in `folder`, where links lead elsewhere.

    Meshes and parts come first, the files that name them last.
    """
    files = sorted((p for p in new.rglob("*") if p.is_file()), key=_depth_first)
    for file in files:
        place = (folder / file.relative_to(new)).resolve()
        place.parent.mkdir(parents=True, exist_ok=True)
        try:
            os.replace(file, place)
        except OSError:  # a link to another disk
            beside = place.with_name(f".{place.name}.{os.getpid()}.part")
            try:
                shutil.copyfile(file, beside)
                os.replace(beside, place)
            finally:
                beside.unlink(missing_ok=True)


def _depth_first(path: Path) -> tuple[int, str]:
    return -len(path.parts), str(path)


def exchange_folder(new: Path, folder: Path) -> None:
    """Puts the tree `new` in the place of `folder`, carrying over the files that it has not."""
    if not folder.exists():
        os.replace(new, folder)
        return
    for old in sorted(folder.rglob("*")):
        copy = new / old.relative_to(folder)
        if old.is_dir():
            copy.mkdir(exist_ok=True)
        elif not copy.exists():
            try:
                os.link(old, copy)
            except OSError:
                shutil.copy2(old, copy)
    shutil.copymode(folder, new)
    if _exchange(new, folder):
        return  # what is now `new` is the old one, and removed as the work folder that it is
    retired = new.with_name(new.name.replace(".work", ".old.work"))
    os.replace(folder, retired)
    try:
        os.replace(new, folder)
    except OSError:
        os.replace(retired, folder)
        raise
    shutil.rmtree(retired, ignore_errors=True)


def _exchange(a: Path, b: Path) -> bool:
    """Exchanges two names at once, so that a kill never leaves one of them out (Linux)."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError, TypeError):
        return False
    done: int = rename(_HERE, os.fsencode(a), _HERE, os.fsencode(b), _EXCHANGE)
    return done == 0
