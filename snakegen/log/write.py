"""Writing a log: everything a person sees and everything a program needs, in one .rrd."""

from __future__ import annotations

import hashlib
from functools import partial
from pathlib import Path
from typing import Any

from snakegen.base.atomic_io import replace_whole
from snakegen.errors import LogError, SnakegenError
from snakegen.log.checksum import placeholder, seal
from snakegen.log.events import merged
from snakegen.log.store import encode
from snakegen.simulation.recording.recording import Recording

APPLICATION = "snakegen"
ENTITY = "recording"
ARCHETYPE = "snakegen.Recording"


def write(recording: Recording, path: str | Path, *, mesh_folder: str | Path | None = None) -> Path:
    """Writes `recording` as a rerun log that opens ready to read.

    The file appears whole or not at all (written beside, then renamed). `read` gets the
    recording back from it bit for bit.

    Args:
        recording: the run, with its metrics, verdict and report where it has them.
        path: the .rrd to write; its folder must exist.
        mesh_folder: where the relative mesh paths of the URDF start; without it meshes are left
            out of the picture, primitives are not.

    Returns:
        The path written.

    Raises:
        LogError: the file cannot be written, or rerun is not to be had.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise LogError(f"cannot write {path}: there is no folder {path.parent}")
    if path.is_dir():
        raise LogError(f"cannot write {path}: it is a folder")
    folder = None if mesh_folder is None else Path(mesh_folder)
    for _ in range(20):  # one time in some thirty the text is compressed
        text = placeholder()
        content = seal(_encoded(recording, folder, text), text)
        if content is not None:
            break
    else:
        raise LogError(f"cannot write {path}: rerun leaves no room for a checksum")
    try:
        replace_whole(path, partial(_put, content), sync=True)
    except SnakegenError as error:
        raise LogError(str(error)) from None
    return path


def _put(content: bytearray, path: Path) -> None:
    path.write_bytes(content)


def identity(header: str) -> str:
    """Returns the recording's id: the digest of its header, which holds the samples' digests.

    Runs that share an id merge in the viewer; equal ids are equal runs.
    """
    return hashlib.sha256(header.encode()).hexdigest()[:32]


def _encoded(recording: Recording, mesh_folder: Path | None, checksum: str) -> bytes:
    """Returns the bytes of the log; rerun's own writer thread would hide a full disk."""
    import rerun as rr

    from snakegen.log.body import log_body
    from snakegen.log.ground_load import as_it_stands, log_plane
    from snakegen.log.layout import blueprint
    from snakegen.log.plots import log_plots, series
    from snakegen.log.scene import scene

    header, files = encode(recording)
    rec = rr.RecordingStream(APPLICATION, recording_id=identity(header))
    seen = as_it_stands(recording)
    view, shown = scene(seen), series(recording)
    strict = rr.strict_mode()
    try:
        rr.set_strict_mode(True)  # else a faulty column becomes a warning inside the log
        stream = rr.binary_stream(rec)
        layout = blueprint(recording, view, shown)
        rec.send_blueprint(layout, make_active=False, make_default=True)
        sealed = rr.DynamicArchetype(ARCHETYPE, components={"checksum": [checksum]})
        rec.log("checksum", sealed, static=True)
        rec.send_recording_name(_title(recording))
        log_body(rec, seen, view, mesh_folder)
        log_plane(rec, recording, view.time)
        log_plots(rec, shown)
        _log_texts(rec, recording)
        rec.log(
            ENTITY,
            rr.DynamicArchetype(
                ARCHETYPE, components={"header": [header], "columns": _binary(files)}
            ),
            static=True,
        )
        content = stream.read(flush=True)
    finally:
        rr.set_strict_mode(strict)
        rec.disconnect()
    if content is None:
        raise LogError("rerun returned no log")
    return content


def _log_texts(rec: Any, recording: Recording) -> None:
    import rerun as rr

    text = rr.TextDocument(report_text(recording), media_type=rr.MediaType.MARKDOWN)
    rec.log("report", text, static=True)
    events = merged(recording.events)
    if events:
        from snakegen.log.style import TIMELINE

        rec.send_columns(
            "events",
            [rr.TimeColumn(TIMELINE, duration=[e.time for e in events])],
            rr.TextLog.columns(text=[e.text for e in events], level=[e.level for e in events]),
        )


def report_text(recording: Recording) -> str:
    """Returns the verdict's checks, then the run's own report, as markdown."""
    parts = []
    if recording.verdict is not None:
        checks = sorted(recording.verdict.checks, key=lambda c: c.passed)  # failures first
        parts.append(f"### {recording.verdict.summary().capitalize()}")
        if "### Checks" not in recording.report:
            parts.append("\n".join(f"- `{c.line()}`" for c in checks))
    if recording.report:
        parts.append(recording.report)
    return "\n\n".join(parts) or "(no report)"


def _title(recording: Recording) -> str:
    parts = [str(recording.meta[k]) for k in ("robot", "mission", "seed") if k in recording.meta]
    return " ".join(parts) or "run"


def _binary(files: list[bytes]) -> Any:
    import pyarrow as pa

    return pa.array(files, pa.large_binary())
