"""What of this machine snakegen can use: the checks behind `snakegen doctor`."""

from __future__ import annotations

import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from snakegen import __version__

_DISK_GB = 1.0  # free, below which builds and caches get into trouble


@dataclass(frozen=True)
class Finding:
    """One check.

    Attributes:
        name: what was looked at.
        status: ``ok``, ``limited`` (a command does without it), ``missing`` (an extra that was
            not installed) or ``broken``.
        detail: what was found.
        remedy: what would mend it, empty where nothing need be.
    """

    name: str
    status: str
    detail: str
    remedy: str = ""

    @property
    def fine(self) -> bool:
        """Whether every command that needs no extra works."""
        return self.status != "broken"

    def to_json(self) -> dict[str, Any]:
        """Returns plain data."""
        return asdict(self)


def examine() -> list[Finding]:
    """Returns the checks of this machine, in the order a person reads them."""
    return [
        Finding("snakegen", "ok", f"{__version__}, Python {platform.python_version()}"),
        _machine(),
        *_packages(),
        _rendering(),
        _viewer(),
        _cache(),
        *_extras(),
    ]


def _machine() -> Finding:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    free = shutil.disk_usage(Path.cwd()).free / 1e9
    text = f"{platform.system()} {platform.machine()}, {cores} cores, {free:.0f} GB of disk free"
    if free < _DISK_GB:
        return Finding("machine", "limited", text, f"free some disk: {_DISK_GB:g} GB is wanted")
    return Finding("machine", "ok", text)


def _packages() -> Iterator[Finding]:
    """Yields a finding for each package that every installation needs."""
    for name, module in _required():
        try:
            version = metadata.version(name)
            __import__(module)
        except metadata.PackageNotFoundError:
            yield Finding(name, "broken", "not installed", f"pip install '{name}'")
        except ImportError as error:
            reason = str(error).splitlines()[0]
            yield Finding(name, "broken", reason, f"pip install --force-reinstall '{name}'")
        else:
            yield Finding(name, "ok", version)


_MODULES = {"pin": "pinocchio", "rerun-sdk": "rerun", "pyyaml": "yaml"}


def _required() -> list[tuple[str, str]]:
    """Returns (package, module) of what snakegen's own metadata requires."""
    names = [_name(line) for line in metadata.requires("snakegen") or [] if "extra ==" not in line]
    return [(name, _MODULES.get(name, name.replace("-", "_"))) for name in names]


def _name(requirement: str) -> str:
    head = requirement.split(";")[0]
    return "".join(c if c.isalnum() or c in "-_." else " " for c in head).split()[0]


def _rendering() -> Finding:
    from snakegen.picture.mujoco_render import render

    with tempfile.TemporaryDirectory() as folder:
        scene, png = Path(folder) / "ball.xml", Path(folder) / "ball.png"
        scene.write_text(
            "<mujoco><worldbody><light pos='0 0 3'/><body><geom type='sphere' size='.3'"
            " rgba='1 0 0 1'/></body></worldbody></mujoco>",
            encoding="utf-8",
        )
        done = render(scene, png, width=160, height=100)
    if done:
        return Finding("rendering", "ok", f"MuJoCo off screen by {done.backend}")
    return Finding(
        "rendering", "limited", f"pictures are drawn as figures: {done.reason}",
        "install a GL library: apt-get install libegl1 libosmesa6",
    )  # fmt: skip


def _viewer() -> Finding:
    from ctypes.util import find_library

    given = os.environ.get("VK_ICD_FILENAMES") or os.environ.get("VK_DRIVER_FILES")
    folders = [Path(root) / "vulkan/icd.d" for root in ("/usr/share", "/etc", "/usr/local/share")]
    driver = given or any(any(folder.glob("*.json")) for folder in folders)
    if sys.platform == "linux" and not (driver and find_library("vulkan")):
        return Finding(
            "viewer", "limited",
            "no Vulkan driver: log pictures are drawn by matplotlib, the viewer may not open",
            "apt-get install mesa-vulkan-drivers libvulkan1",
        )  # fmt: skip
    return Finding("viewer", "ok", "rerun has a graphics driver")


def _cache() -> Finding:
    from snakegen.kernels.core.jit import cache_folder, cold

    folder = cache_folder("control.control_tick")
    if folder is None:
        return Finding(
            "kernel cache", "limited", "cannot be written: every command compiles anew",
            "set SNAKEGEN_CACHE_DIR to a folder that can be written",
        )  # fmt: skip
    text = "empty: the first flight compiles for a minute or two" if cold() else "has kernels"
    return Finding("kernel cache", "ok", f"{folder.parent}, {text}")


def _extras() -> Iterator[Finding]:
    for extra, (module, what) in EXTRAS.items():
        try:
            __import__(module)
        except ImportError:
            yield Finding(f"[{extra}]", "missing", what, f"pip install 'snakegen[{extra}]'")
        else:
            yield Finding(f"[{extra}]", "ok", what)


EXTRAS = {
    "cluster": ("distributed", "sweeps on a Dask cluster"),
    "gym": ("gymnasium", "the learning environment snakegen/Flight-v0"),
    "usd": ("pxr", "build --format usd"),
    "mcap": ("mcap", "inspect --against recording.mcap"),
}
"""Extra → the module that it brings, and what it is for."""
