"""Writing files whole or not at all: beside the target, then renamed over it."""

import errno
import glob
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Timer, get_ident
from types import FrameType

from snakegen.base.bounded_text import refuse_special
from snakegen.errors import SnakegenError

INTERRUPTED = Event()


def on_interrupt(signum: int, frame: FrameType | None) -> None:
    """Raises KeyboardInterrupt and keeps in mind that it did: libraries may swallow it.

    While a module is imported the signal is sent again instead: an exception there would end in a
    library's own error, or be printed and ignored.
    """
    INTERRUPTED.set()
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            send_again(signum)
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def send_again(signum: int = signal.SIGINT) -> None:
    """Sends a signal to this process again, 20 ms from now."""
    later = Timer(0.02, os.kill, (os.getpid(), signum))
    later.daemon = True
    later.start()


def _reason(error: OSError) -> str:
    import shutil

    if isinstance(error, shutil.Error) and error.args and isinstance(error.args[0], list):
        first = str(error.args[0][0][-1])  # of many files, each with where from, where to and why
        return first.split("] ", 1)[-1].split(": '", 1)[0]
    return error.strerror or str(error)


def write_atomically(path: Path, content: str | bytes) -> None:
    """Writes `content` to `path`, text as UTF-8; an error or Ctrl-C leaves what stood there.

    Raises:
        SnakegenError: the folder cannot be made or written, or the disk is full.
    """
    data = content.encode() if isinstance(content, str) else content
    replace_whole(path, lambda beside: beside.write_bytes(data))


def _refuse_loop(target: Path) -> None:
    """Raises where links on the way to `target` lead in a circle.

    Raises:
        OSError: what the system says of it; before Python 3.13 `resolve` has an error of its own.
    """
    try:
        target.resolve()
    except RuntimeError:
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(target)) from None


@contextmanager
def writing(target: Path) -> Iterator[None]:
    """Turns what the system says while `target` is written into one clear line.

    Raises:
        SnakegenError: no permission, no space, a file in the way, a device or named pipe, which a
            rename would replace by a file.
    """
    try:
        _refuse_loop(target)
        if target.exists():
            refuse_special(target)
        yield
    except OSError as error:
        raise SnakegenError(f"{target}: cannot be written ({_reason(error)}).") from None


def require_suffix(path: str | Path, *suffixes: str) -> None:
    """Refuses a file to write whose suffix names another format than its content.

    Raises:
        SnakegenError: the suffixes that would do are named.
    """
    if not str(path).endswith(suffixes):
        names = " or ".join(suffixes)
        raise SnakegenError(f"{path}: this content needs a file name that ends in {names}.")


def check_writable(path: Path) -> None:
    """Refuses a file that cannot be written before long work is done for it; leaves no trace.

    Raises:
        SnakegenError: no permission, no space, a file in the way.
    """
    import tempfile

    with writing(path):
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, "it is a folder")
        there = next(p for p in path.absolute().parents if p.exists())
        with tempfile.TemporaryFile(dir=there):
            pass


@contextmanager
def folder_whole(target: Path) -> Iterator[Path]:
    """Yields an empty folder; on success its files replace those of `target`.

    Files of `target` that the new set does not have stay; on any error `target` is untouched. A
    plain folder changes as a whole, by one exchange of names. The current folder, a mount point,
    a folder in one that cannot be written and one that holds links cannot be exchanged: there
    each file is renamed to its place on its own, through links, which stay.

    Raises:
        SnakegenError: the folder cannot be made or written, or another process writes it.
    """
    from snakegen.base.file_lock import exclusive  # what these import, most commands do without
    from snakegen.base.folder_swap import exchange_folder, move_files, must_stay

    target = Path(target)
    with writing(target):
        if target.exists() and not target.is_dir():
            raise SnakegenError(f"{target}: is a file; -o needs a folder.")
        real = target.resolve()
        inside = real.is_dir() and must_stay(real)
        parent = real if inside else real.parent
        parent.mkdir(parents=True, exist_ok=True)
    lock = parent / f".{real.name}.lock"
    with exclusive(target, lock), work_folder(parent, real, shown=target) as beside:
        yield beside
        if INTERRUPTED.is_set():
            raise KeyboardInterrupt
        (move_files if inside else exchange_folder)(beside, real)


@contextmanager
def work_folder(parent: Path, target: Path, shown: Path) -> Iterator[Path]:
    """Yields an empty hidden folder in `parent`, removed at the end; the caller holds the lock.

    Work folders of `target` that killed processes left there are removed first; errors name
    `shown` in place of the hidden folder.

    Raises:
        SnakegenError: it cannot be made, or an error of the system within the block.
    """
    import shutil

    with writing(shown):
        for left in parent.glob(f".{glob.escape(target.name)}.*.work"):
            shutil.rmtree(left, ignore_errors=True)
        beside = parent / f".{target.name}.{os.urandom(4).hex()}.work"
        beside.mkdir()  # with the permissions of the umask
        try:
            yield beside
        except SnakegenError as error:
            error.args = (str(error).replace(str(beside), str(shown)),)
            raise
        finally:
            shutil.rmtree(beside, ignore_errors=True)


def replace_whole(path: Path, write: Callable[[Path], object], *, sync: bool = False) -> None:
    """Lets `write` fill a file beside `path`, then renames it over `path`.

    Args:
        path: to write; the file that a link names, where it is one.
        write: gets the path of the file to fill.
        sync: also bring the content to the disk before the rename, against power loss.

    Raises:
        SnakegenError: the file cannot be written; what stood at `path` is untouched.
    """
    path = Path(path)
    with writing(path):
        target = path.resolve()
        target.parent.mkdir(parents=True, exist_ok=True)
        remove_left_parts(target)
        beside = target.with_name(f".{target.name}.{os.getpid()}.{get_ident():x}.part")
        try:
            write(beside)
            if sync:
                sync_file(beside)
            os.replace(beside, target)
            if sync:
                sync_file(target.parent)
        finally:
            beside.unlink(missing_ok=True)


def remove_left_parts(target: Path) -> None:
    """Removes what processes that were killed left of `target`, half-written next to it."""
    for left in target.parent.glob(f".{glob.escape(target.name)}.*.part"):
        owner = left.name.removeprefix(f".{target.name}.").split(".")[0]
        if not owner.isdigit():
            continue
        try:
            os.kill(int(owner), 0)
        except ProcessLookupError:
            with suppress(OSError):
                left.unlink()
        except (OSError, OverflowError):  # another user's
            continue


def sync_file(path: Path) -> None:
    """Brings a file, or the names in a folder, to the disk; a no-op where the system cannot."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EBADF):
            raise
    finally:
        os.close(handle)
