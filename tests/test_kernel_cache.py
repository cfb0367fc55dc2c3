"""The kernels' disk cache: entries survive copies, damage is recompiled, disks may be full."""

import pickle

import numpy as np
import pytest
from numba import njit

from snakegen.kernels import kernel_cache
from snakegen.kernels.kernel_cache import Entries, KernelCache

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
