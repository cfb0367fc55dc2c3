"""Terminal output of a run: progress, checks, prediction and measured result."""

import sys
from pathlib import Path
from typing import Any

MOST_EVENTS = 8  # lines of a failed run; the log has them all


def result_json(recording: Any, path: Path) -> dict[str, Any]:
    """Returns what --json prints: metrics, facts of the mission, verdict and where the log is."""
    judged = recording.verdict
    keys = (
        "robot",
        "mission",
        "seed",
        "mode",
        "gains",
        "allocator",
        "ideal",
        "feed_forward",
        "stopped",
    )
    keep = (*keys, "modal_frequencies_hz", "facts")
    return (
        {k: recording.meta[k] for k in keep if k in recording.meta}
        | recording.metrics
        | {
            "log": str(path),
            "start_posture_rad": start_posture(recording),
            "verdict": judged.to_json() if judged else None,
            "passed": bool(judged and judged.passed),
        }
    )


def result_lines(recording: Any, path: Path) -> list[str]:
    """Returns what a person reads: the log, what happened, the checks, and the verdict last.

    A run that failed tells its events too, for they say why.
    """
    from snakegen.robot.posture import posture_text
    from snakegen.simulation.recording.summary import outcome

    lines = [f"log: {path}"]
    if start := start_posture(recording):
        base_rpy = start.pop("base_rpy", ())
        lines.append(f"start: {posture_text(start, base_rpy)}")
    if recording.meta.get("stopped"):
        lines.append(f"ended early: {recording.meta['stopped']}")
    modes = recording.meta.get("modal_frequencies_hz")
    if modes:
        shown = ", ".join(f"{f:.2f}" for f in modes[:6])
        lines.append(f"elastic links: natural frequencies {shown} … Hz")
    judged = recording.verdict
    if judged is None or not judged.passed:
        lines += _events(recording)
    lines += outcome(recording.meta, recording.metrics)
    if judged is None:
        return [*lines, "verdict: none"]
    lines += [f"  {check.line()}" for check in judged.checks]
    led = recording.meta.get("feed_forward")
    by = f", with feed-forward {led}" if led else ""
    return [*lines, f"verdict: {judged.summary()}{by}"]


def start_posture(recording: Any) -> dict[str, Any]:
    """Returns the joint angles [rad] by name, and the base's attitude, with which a run begins."""
    from snakegen.base.geometry import rotation_from_xyzw, rpy_from_rotation

    out: dict[str, Any] = {}
    if "joint_angle" in recording.channels:
        joints = recording.channel("joint_angle")
        out |= dict(zip(joints.labels, joints.values[0].tolist(), strict=True))
    if "attitude" in recording.channels:
        at = rotation_from_xyzw(recording.channel("attitude").values[0])
        out["base_rpy"] = rpy_from_rotation(at).tolist()
    return out


def _events(recording: Any) -> list[str]:
    """Returns the first events as lines."""
    from snakegen.log.events import merged

    lines = [f"{event.time:9.2f} s  {event.text}" for event in merged(recording.events)]
    if len(lines) > MOST_EVENTS:
        lines[MOST_EVENTS:] = [f"             … {len(lines) - MOST_EVENTS} more in the log"]
    return lines


class progress_bar:
    """A progress bar on stderr with an estimate; silent when stderr is no terminal."""

    def __init__(self, title: str) -> None:
        self.title = title
        self.bar: Any = None

    def __enter__(self) -> Any:
        if not sys.stderr.isatty():
            return None
        from rich.console import Console
        from rich.progress import Progress

        self.bar = Progress(console=Console(stderr=True), transient=True)
        self.bar.start()
        task = self.bar.add_task(self.title, total=1)

        def step(done: int, total: int) -> None:
            self.bar.update(task, completed=done, total=total)

        return step

    def __exit__(self, *_: Any) -> None:
        if self.bar is not None:
            self.bar.stop()
