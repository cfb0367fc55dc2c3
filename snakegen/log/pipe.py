"""What rerun writes, through a pipe: a full disk is seen, and nothing is held in memory.

rerun writes logs in a thread of its own, which swallows the errors of a full disk and then never
flushes again. So it writes to a pipe, which is always read to its end.
"""

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread

_AT_ONCE = 1 << 20  # bytes


@contextmanager
def pipe_into(write: Callable[[bytes], object]) -> Iterator[Path]:
    """Yields the path of a pipe; what is written there until it is closed goes to `write`.

    Raises:
        OSError: what `write` raised, at the end.
    """
    errors: list[BaseException] = []

    def pump(source: int) -> None:
        while data := os.read(source, _AT_ONCE):
            if not errors:
                try:
                    write(data)
                except BaseException as error:  # raised again below, in the caller's thread
                    errors.append(error)

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.rrd"
        os.mkfifo(path)
        source = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        keeper = os.open(path, os.O_WRONLY)  # the end comes when both have closed it
        os.set_blocking(source, True)
        reader = Thread(target=pump, args=(source,), daemon=True)
        reader.start()
        try:
            yield path
        finally:
            os.close(keeper)
            reader.join()
            os.close(source)
    if errors:
        raise errors[0]
