"""Writing a log: everything a person sees and everything a program needs, in one .rrd."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any

from snakegen.base.atomic_io import replace_whole
from snakegen.base.memory import trim
from snakegen.base.sample_store import samples_in
from snakegen.errors import LogError, SnakegenError
from snakegen.log.checksum import Sealed, placeholder
from snakegen.log.events import merged
from snakegen.log.pipe import pipe_into
from snakegen.log.store import encode_into
from snakegen.simulation.recording.recording import Recording

APPLICATION = "snakegen"
ENTITY = "recording"
SAMPLES = "recording/samples"
ARCHETYPE = "snakegen.Recording"
PART = 1 << 20  # bytes of samples that are written together
_LATE = 2.0  # s, after which the checksum's text is taken to be compressed


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
    try:
        with samples_in(path.parent):
            replace_whole(path, partial(_fill, recording, folder), sync=True)
    except SnakegenError as error:
        raise LogError(str(error)) from None
    return path


def _fill(recording: Recording, mesh_folder: Path | None, path: Path) -> None:
    """Writes the log; one time in some thirty the checksum's text is compressed: then again."""

    def beside() -> IO[bytes]:
        return TemporaryFile(dir=path.parent)

    header, files = encode_into(recording, beside)
    try:
        for _ in range(20):
            text = placeholder()
            sealed = Sealed(path, text)
            try:
                with pipe_into(sealed.write) as pipe:
                    _write_to(pipe, recording, mesh_folder, header, files, sealed, text)
            finally:
                sealed.close()
            if sealed.found.is_set():
                return
    finally:
        for file in files:
            file.close()
    raise LogError(f"cannot write {path}: rerun leaves no room for a checksum")


def identity(header: str) -> str:
    """Returns the recording's id: the digest of its header, which holds the samples' digests.

    Runs that share an id merge in the viewer; equal ids are equal runs.
    """
    return hashlib.sha256(header.encode()).hexdigest()[:32]


def _write_to(
    pipe: Path,
    recording: Recording,
    mesh_folder: Path | None,
    header: str,
    files: Sequence[IO[bytes]],
    sealed: Sealed,
    checksum: str,
) -> None:
    """Lets rerun write the log to `pipe`; leaves early where its checksum was compressed."""
    import rerun as rr

    from snakegen.log.body import log_body
    from snakegen.log.ground_load import as_it_stands, log_plane
    from snakegen.log.layout import blueprint
    from snakegen.log.plots import log_plots, series
    from snakegen.log.scene import scene
    from snakegen.log.states import lanes, log_states

    rec = rr.RecordingStream(APPLICATION, recording_id=identity(header))
    strict = rr.strict_mode()
    try:
        rr.set_strict_mode(True)  # else a faulty column becomes a warning inside the log
        rec.save(pipe)
        place = rr.DynamicArchetype(ARCHETYPE, components={"checksum": [checksum]})
        rec.log("checksum", place, static=True)
        rec.flush()
        if not sealed.found.wait(_LATE):
            return
        seen = as_it_stands(recording)
        trim()
        view, shown = scene(seen), series(recording)
        trim()
        states = lanes(recording)
        layout = blueprint(recording, view, shown, states=bool(states))
        rec.send_blueprint(layout, make_active=False, make_default=True)
        rec.send_recording_name(_title(recording))
        log_body(rec, seen, view, mesh_folder)
        log_plane(rec, recording, view.time)
        del view, layout
        log_plots(rec, shown, recording.release)
        del shown
        log_states(rec, states)
        _log_texts(rec, recording)
        rec.flush()
        trim()
        _log_samples(rec, header, files)
    finally:
        rr.set_strict_mode(strict)
        rec.disconnect()


def _log_samples(rec: Any, header: str, files: Sequence[IO[bytes]]) -> None:
    """Writes the header, and the files in parts that memory holds."""
    import pyarrow as pa
    import rerun as rr

    for i, file in enumerate(files):
        file.seek(0)
        part = 0
        while data := file.read(PART):
            content = {"bytes": pa.array([data], pa.large_binary())}
            place = f"{SAMPLES}/{i}/{part}"
            rec.log(place, rr.DynamicArchetype(ARCHETYPE, components=content), static=True)
            rec.flush()
            part += 1
    rec.log(ENTITY, rr.DynamicArchetype(ARCHETYPE, components={"header": [header]}), static=True)


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
