"""The picture of a log: as rerun's viewer draws it, else drawn by matplotlib from the log."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time as clock
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from snakegen.base.atomic_io import replace_whole
from snakegen.errors import LogError, SnakegenError
from snakegen.log.read import read
from snakegen.log.style import TIMELINE
from snakegen.simulation.recording.recording import Recording

STARTING = 30.0  # s a viewer may take to answer

NOTES_GONE = 4.5  # s until the notes that a starting viewer pops up over the plots have faded


def snapshot(
    path: str | Path,
    png: str | Path,
    time: float | None = None,
    *,
    renderer: str = "auto",
    size: tuple[int, int] = (1600, 1000),
) -> str:
    """Draws the log `path` into the file `png`.

    Args:
        path: an .rrd that snakegen wrote.
        png: the picture to write; its name ends in .png.
        time: s, within the log; by default the middle of what is judged.
        renderer: ``viewer`` (rerun's own, without a window, on 127.0.0.1), ``matplotlib``, or
            ``auto``: the viewer where it starts, else matplotlib.
        size: pixels.

    Returns:
        The renderer that drew it, ``viewer`` or ``matplotlib``.

    Raises:
        LogError: the log cannot be read, it has no such instant, the picture cannot be written, or
            the viewer was asked for and does not start (it needs a Vulkan driver).
    """
    path, png = Path(path), Path(png)
    if png.suffix.lower() != ".png":
        raise LogError(f"{png}: a picture's name must end in .png")
    recording = read(path)
    if not png.parent.is_dir():
        raise LogError(f"cannot write {png}: there is no folder {png.parent}")
    if renderer not in ("auto", "viewer", "matplotlib"):
        raise LogError(f"no renderer '{renderer}'; there are auto, viewer, matplotlib")
    at = _instant(recording, time, path)
    if renderer != "matplotlib":
        try:
            _draw_with_viewer(path, png, at, size)
            return "viewer"
        except LogError:
            if renderer == "viewer":
                raise
    from snakegen.log.plain_picture import draw

    draw(recording, png, at, size)
    return "matplotlib"


def _instant(recording: Recording, time: float | None, path: Path) -> float:
    """Returns the instant [s] to draw; refuses one that the log does not have."""
    first, last = float(recording.time[0]), float(recording.time[-1])
    if time is None:  # of what is judged: before it a robot may only hover and trim itself
        start, end = recording.meta.get("metrics_window_s") or (first, last)
        return 0.5 * (max(float(start), first) + min(float(end), last))
    tick = (last - first) / max(recording.time.size - 1, 1)  # a run of 2 s ends a tick before 2
    if not first <= time <= last + 1.5 * tick:
        raise LogError(f"{path} has no time {time:g} s; it goes from {first:g} to {last:g} s")
    return min(float(time), last)


def _draw_with_viewer(path: Path, png: Path, at: float, size: tuple[int, int]) -> None:
    with tempfile.TemporaryDirectory() as folder, _viewer(size) as client:
        shot = Path(folder) / "shot.png"
        _wait_loaded(client, client.open(str(path.resolve())))
        client.set_time(TIMELINE, duration=at, play_state="paused")
        client.save_screenshot(str(shot))  # makes it load what this instant shows
        clock.sleep(NOTES_GONE)  # counted by its frames, of which a busy machine draws none before
        client.save_screenshot(str(shot))
        if not shot.is_file():
            raise LogError(f"the viewer drew no picture of {path}")
        try:
            replace_whole(png, lambda part: shutil.copyfile(shot, part))
        except SnakegenError as error:
            raise LogError(str(error)) from None


def _wait_loaded(client: Any, opened: Any) -> None:
    until = clock.monotonic() + STARTING
    while opened.loading and clock.monotonic() < until:
        if not client.get_state().loading:
            return
        clock.sleep(0.1)


@contextlib.contextmanager
def _viewer(size: tuple[int, int]) -> Iterator[Any]:
    """A viewer without a window on a free port of 127.0.0.1; ended with all its children.

    `ViewerClient.spawn` would start it listening on every address, so it is started here.
    """
    from rerun.experimental import ViewerClient

    port = _free_port()
    command = [sys.executable, "-m", "rerun", "--headless", "--bind", "127.0.0.1"]
    command += ["--port", str(port), "--hide-welcome-screen"]
    command += ["--window-size", f"{size[0]}x{size[1]}"]
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(command, stdout=output, stderr=output, start_new_session=True)
        try:
            yield _connected(process, ViewerClient, f"rerun+http://127.0.0.1:{port}/proxy", output)
        except (RuntimeError, ValueError, ConnectionError) as error:
            # Without a driver it answers first and dies at its first frame.
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(2.0)
            raise LogError(_complaint(process, output) or f"rerun's viewer: {error}") from None
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGTERM)
            try:
                process.wait(5.0)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


def _connected(process: Any, client: Any, url: str, output: Any) -> Any:
    until = clock.monotonic() + STARTING
    while clock.monotonic() < until:
        complaint = _complaint(process, output)
        if complaint:
            raise LogError(complaint)
        with contextlib.suppress(Exception):  # it is not listening yet
            viewer = client.connect(url)
            viewer.get_state()
            return viewer
        clock.sleep(0.1)
    raise LogError(f"rerun's viewer did not answer within {STARTING:.0f} s")


def _complaint(process: Any, output: Any) -> str:
    """Returns why the viewer ended, in one line; nothing while it runs."""
    if process.poll() is None:
        return ""
    output.seek(0)
    text = output.read().decode(errors="replace")
    if "No graphics adapter" in text or "render context" in text:
        return (
            "rerun's viewer found no graphics driver that serves it; Debian's "
            "mesa-vulkan-drivers and libvulkan1 give it a software one"
        )
    last = text.strip().splitlines()[-1:] or ["it said nothing"]
    return f"rerun's viewer ended: {last[0]}"


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def view(path: str | Path) -> None:
    """Opens a log in rerun's viewer, in a process of its own that listens on 127.0.0.1 alone.

    Raises:
        LogError: the log cannot be read.
    """
    read(path)
    command = [sys.executable, "-m", "rerun", "--bind", "127.0.0.1", "--port", str(_free_port())]
    subprocess.Popen([*command, str(path)], start_new_session=True, stderr=subprocess.DEVNULL)
