"""Exclusive writing of a file: a lock that ends with its process and names its owner.

The lock is an advisory `flock` on ``.NAME.lock`` next to the file. The kernel drops it when the
process ends, however it ends, so a lock file left behind by a killed process on this host never
blocks. What another host left cannot be judged from here and is refused.
"""

import json
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from getpass import getuser
from pathlib import Path
from typing import Any

from snakegen.errors import SnakegenError

try:
    import fcntl
except ImportError:  # a system without flock: the owner's process id decides
    fcntl = None  # type: ignore[assignment]


class InUseError(SnakegenError):
    """A file that another process is writing."""


def lock_of(target: Path) -> Path:
    """Returns the lock file of `target`, beside it."""
    absolute = Path(target).absolute()
    return absolute.with_name(f".{absolute.name}.lock")


@contextmanager
def exclusive(target: Path, lock: Path | None = None) -> Iterator[None]:
    """Holds the lock of `target` for the time of the block.

    Args:
        target: file or folder to write.
        lock: the lock file; `lock_of` the target if not given.

    Raises:
        InUseError: another process writes it; the message names process, user, host and start.
        SnakegenError: the folder cannot be written.
    """
    target = Path(target)
    path = lock_of(target) if lock is None else lock
    made = [folder for folder in path.parents if not folder.exists()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = _acquire(path, target)
    except OSError as error:
        reason = error.strerror or error
        raise SnakegenError(f"{target}: cannot be written ({reason}).") from None
    try:
        yield
    finally:
        path.unlink(missing_ok=True)  # while it is held: nobody else's can stand there
        os.close(handle)
        with suppress(OSError):  # nothing was written: no folder stays
            for folder in made:
                folder.rmdir()


def _acquire(path: Path, target: Path) -> int:
    """Returns the descriptor of the lock file, held and marked with this process as its owner."""
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            held = _flock(handle)
            owner = _owner(handle)
            if held is False or _is_alive(owner, known_free=held is True):
                raise InUseError(_refusal(target, path, owner))
            if _same_file(handle, path):
                _sign(handle, path)
                return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)  # its last owner removed it between opening and locking: once more


def _sign(handle: int, path: Path) -> None:
    """Writes this process into the lock file that it holds; on a full disk none is left."""
    try:
        os.ftruncate(handle, 0)
        os.pwrite(handle, json.dumps(_myself()).encode(), 0)
    except OSError:
        path.unlink(missing_ok=True)
        raise


def _flock(handle: int) -> bool | None:
    """Returns True where the lock was taken, False where another holds it, None without locks."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a network file system that knows no locks
        return None
    return True


def _same_file(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), os.stat(path))
    except FileNotFoundError:
        return False


def _myself() -> dict[str, Any]:
    try:
        user = getuser()
    except (OSError, KeyError):  # a container's number without a name
        user = str(os.getuid()) if hasattr(os, "getuid") else "unknown"
    since = datetime.now().isoformat(sep=" ", timespec="seconds")
    return {"pid": os.getpid(), "user": user, "host": socket.gethostname(), "since": since}


def _owner(handle: int) -> dict[str, Any] | None:
    """Returns what the lock file says of its owner; None where it is empty or unreadable."""
    try:
        found = json.loads(os.pread(handle, 4096, 0))
        return found if isinstance(found, dict) and {"pid", "host"} <= found.keys() else None
    except ValueError:
        return None


def _is_alive(owner: dict[str, Any] | None, *, known_free: bool) -> bool:
    """Tells whether the named owner may still be writing although the lock could be taken."""
    if owner is None:
        return False
    if owner["host"] != socket.gethostname():
        return True  # locks of some network file systems end at their host
    if known_free:
        return False
    try:
        os.kill(int(owner["pid"]), 0)
    except (ProcessLookupError, ValueError):
        return False
    except PermissionError:
        return True
    return True


def _refusal(target: Path, path: Path, owner: dict[str, Any] | None) -> str:
    if owner is None:
        return f"{target}: another process is writing it; wait for its end or name another file."
    who = f"process {owner['pid']} of {owner.get('user', 'unknown')} on {owner['host']}"
    remedy = "wait for its end or name another file"
    if owner["host"] != socket.gethostname():
        remedy += f"; if it has ended, remove {path}"
    return f"{target}: {who} is writing it since {owner.get('since', 'unknown')}; {remedy}."
