"""The kernels' disk cache: entries survive copies, damage is recompiled, disks may be full."""

import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from numba import njit

from snakegen.kernels.core import jit, kernel_cache
from snakegen.kernels.core.kernel_cache import Entries, KernelCache

KEY = ("(float64,)", ("x86_64", "cpu", "+avx"), ("bytecode", "closure"))


def _square(x):
    return x * x + 1.0


def _compiled(folder):
    dispatcher = njit(_square)
    dispatcher._cache = KernelCache(_square, folder)
    return dispatcher


def _loaded(folder):
    """Returns the value at 3 and whether it came from the disk."""
    dispatcher = _compiled(folder)
    value = dispatcher(3.0)
    return value, sum(dispatcher.stats.cache_hits.values()) == 1


@pytest.fixture
def entry(tmp_path):
    assert _loaded(tmp_path) == (10.0, False)
    (path,) = tmp_path.glob("*.nbc")
    return path


def test_a_second_process_loads_what_the_first_compiled(entry, tmp_path):
    assert _loaded(tmp_path) == (10.0, True)


@pytest.mark.parametrize("damage", ["empty", "truncated", "garbage", "flipped", "foreign"])
def test_a_damaged_entry_is_compiled_again_and_replaced(entry, tmp_path, damage):
    good = entry.read_bytes()
    flipped = bytearray(good)
    flipped[len(good) // 2] ^= 1
    payload = pickle.dumps(("another", "tuple"))
    entry.write_bytes(
        {
            "empty": b"",
            "truncated": good[:-7],
            "garbage": np.random.default_rng(1).bytes(len(good)),
            "flipped": bytes(flipped),
            "foreign": __import__("hashlib").sha256(payload).digest() + payload,
        }[damage]
    )
    assert _loaded(tmp_path) == (10.0, False)
    assert _loaded(tmp_path) == (10.0, True)


def test_a_full_disk_costs_one_note(tmp_path, monkeypatch, capsys):
    def full(*args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(kernel_cache.os, "replace", full)
    monkeypatch.setattr(kernel_cache, "_noted", set())
    assert _loaded(tmp_path) == (10.0, False)
    assert _loaded(tmp_path) == (10.0, False)
    assert not list(tmp_path.iterdir())
    assert capsys.readouterr().err.count("note: ") == 1


def test_keys_of_other_processors_and_byte_codes_do_not_meet(tmp_path):
    entries = Entries(tmp_path, "kernel")
    entries.save(KEY, "here")
    assert entries.load(KEY) == "here"
    for at, other in enumerate(["(int64,)", ("x86_64", "generic", ""), ("other", "closure")]):
        assert entries.load(tuple(other if i == at else part for i, part in enumerate(KEY))) is None
    entries.flush()
    assert entries.load(KEY) is None


def test_a_truly_full_disk_costs_one_note(tmp_path):
    """A limit on the size of files makes real writes fail, as a full disk does."""
    code = (
        "import pathlib, resource, signal, sys\n"
        "from numba import njit\n"
        "from snakegen.kernels.core.kernel_cache import KernelCache\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (512, 512))\n"
        "def square(x):\n    return x * x + 1.0\n"
        "for _ in range(2):\n"
        "    f = njit(square)\n"
        "    f._cache = KernelCache(square, pathlib.Path(sys.argv[1]))\n"
        "    print(f(3.0))\n"
    )
    script = tmp_path / "script.py"
    script.write_text(code)
    cache = tmp_path / "cache"
    done = subprocess.run(
        [sys.executable, str(script), str(cache)], capture_output=True, text=True, check=True
    )
    assert done.stdout == "10.0\n10.0\n" and done.stderr.count("note: ") == 1
    assert "File too large" in done.stderr and list(cache.iterdir()) == []


def test_processes_that_compile_at_once_leave_one_whole_entry(tmp_path):
    code = (
        "import pathlib, sys\n"
        "from numba import njit\n"
        "from snakegen.kernels.core.kernel_cache import KernelCache\n"
        "def square(x):\n    return x * x + 1.0\n"
        "f = njit(square)\n"
        "f._cache = KernelCache(square, pathlib.Path(sys.argv[1]))\n"
        "print(f(3.0))\n"
    )
    script = tmp_path / "script.py"
    script.write_text(code)
    command = [sys.executable, str(script), str(tmp_path / "cache")]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(3)]
    assert [child.communicate()[0] for child in both] == ["10.0\n"] * 3
    assert len(list((tmp_path / "cache").iterdir())) == 1


@pytest.mark.parametrize("kind", ["another user's", "writable for all", "not writable", "a file"])
def test_a_folder_that_is_not_ones_own_is_not_used(tmp_path, monkeypatch, capsys, kind):
    """Its entries would be code of somebody else; kernels compile in memory, with one note."""
    roots = [tmp_path / name for name in ("one", "two", "three")]
    for root in roots:
        (root / "snakegen").mkdir(parents=True)
        if kind == "writable for all":
            (root / "snakegen").chmod(0o777)
        elif kind == "a file":
            (root / "snakegen").rmdir()
            (root / "snakegen").write_text("")
    if kind == "another user's":
        mine = os.getuid()
        monkeypatch.setattr(kernel_cache.os, "getuid", lambda: mine + 1)
    elif kind == "not writable":

        def refuse(*args, **options):
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr(kernel_cache.tempfile, "TemporaryFile", refuse)
    monkeypatch.setenv("SNAKEGEN_CACHE_DIR", str(roots[0]))
    monkeypatch.setenv("XDG_CACHE_HOME", str(roots[1]))
    monkeypatch.setenv("HOME", str(roots[2]))
    (roots[2] / ".cache").mkdir()
    if kind in ("a file", "writable for all"):
        (roots[2] / ".cache").rmdir()
        (roots[2] / ".cache").write_text("")
    monkeypatch.setattr(kernel_cache, "_noted", set())
    jit.cache_folder.cache_clear()
    try:
        assert jit.cache_folder("linear") is None and jit.cache_folder("spd") is None
    finally:
        jit.cache_folder.cache_clear()
    assert capsys.readouterr().err.count("note: kernel cache ") == 1


def test_folders_of_earlier_sources_are_removed(tmp_path):
    """Those unused for a month, and the longest unused beyond a number; others stay."""
    folders = [tmp_path / f"linear-{i:016x}" for i in range(30)]
    now = kernel_cache.time.time()
    for i, folder in enumerate(folders):
        folder.mkdir()
        (folder / "x.nbc").write_bytes(b"x")
        os.utime(folder, (now - 3600 * (i + 1),) * 2)
    os.utime(folders[3], (now - 31 * 86400,) * 2)
    (tmp_path / "linear-notes").mkdir()
    (tmp_path / f"linear_more-{0:016x}").mkdir()
    new = tmp_path / f"linear-{99:016x}"
    kernel_cache.prepare_folder(new, "linear")
    left = {p.name for p in tmp_path.iterdir()}
    assert new.name in left and folders[3].name not in left and folders[29].name not in left
    assert {"linear-notes", f"linear_more-{0:016x}", folders[0].name} <= left
    assert sum(p.name.startswith("linear-0") for p in tmp_path.iterdir()) == 24
    kernel_cache.prepare_folder(folders[28], "linear")  # a new one again
