"""Writing a log: everything a person sees and everything a program needs, in one .rrd."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any

from snakegen.errors import LogError
from snakegen.log.events import merged
from snakegen.log.store import encode
from snakegen.verify.recording import Recording

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
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        _write(recording, beside, None if mesh_folder is None else Path(mesh_folder))
        beside.replace(path)
    except OSError as error:
        raise LogError(f"cannot write {path}: {error.strerror or error}") from None
    finally:
        beside.unlink(missing_ok=True)
    return path


def _write(recording: Recording, path: Path, mesh_folder: Path | None) -> None:
    import rerun as rr

    from snakegen.log.body import log_body
    from snakegen.log.layout import blueprint
    from snakegen.log.plots import log_plots, series
    from snakegen.log.scene import scene

    header, files = encode(recording)
    # Runs that share an id merge in the viewer. The header holds the samples' digests: equal
    # ids are equal runs.
    identity = hashlib.sha256(header.encode()).hexdigest()[:32]
    rec = rr.RecordingStream(APPLICATION, recording_id=identity)
    view, shown = scene(recording), series(recording)
    strict = rr.strict_mode()
    try:
        rr.set_strict_mode(True)  # else a faulty column becomes a warning inside the log
        rec.save(path, default_blueprint=blueprint(recording, view, shown))
        rec.send_recording_name(_title(recording))
        log_body(rec, recording, view, mesh_folder)
        log_plots(rec, shown)
        _log_texts(rec, recording)
        rec.log(
            ENTITY,
            rr.DynamicArchetype(
                ARCHETYPE, components={"header": [header], "columns": _binary(files)}
            ),
            static=True,
        )
        rec.flush()
    finally:
        rr.set_strict_mode(strict)
        rec.disconnect()


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
