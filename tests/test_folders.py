"""Folders and files that a command writes: links, mounts, umask, full disks, signals, locales."""

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from snakegen.base import atomic_io, folder_swap
from snakegen.base.atomic_io import folder_whole, replace_whole
from snakegen.base.file_lock import InUseError, exclusive
from snakegen.errors import AnalysisError, SnakegenError
from snakegen.sweep.samples import read_postures


def put(target: Path, **contents: str) -> None:
    """Writes a set of files as a build does; `a__b` is a file in a folder."""
    with folder_whole(target) as folder:
        for name, text in contents.items():
            path = folder / name.replace("__", "/")
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)


def tree(folder: Path) -> dict[str, str]:
    return {str(p.relative_to(folder)): p.read_text() for p in folder.rglob("*") if p.is_file()}


def test_a_linked_folder_stays_a_link(tmp_path: Path) -> None:
    real, link = tmp_path / "real", tmp_path / "link"
    real.mkdir()
    (real / "mine.txt").write_text("mine")
    link.symlink_to(real)
    put(link, robot="new")
    assert link.is_symlink() and tree(real) == {"mine.txt": "mine", "robot": "new"}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["link", "real"]


def test_links_within_a_folder_are_written_through(tmp_path: Path) -> None:
    out, meshes, other = tmp_path / "out", tmp_path / "meshes", tmp_path / "other.urdf"
    for folder in (out, meshes):
        folder.mkdir()
    (meshes / "mine.stl").write_text("mine")
    other.write_text("old")
    (out / "meshes").symlink_to(meshes)
    (out / "robot.urdf").symlink_to("../other.urdf")
    put(out, **{"robot.urdf": "new", "meshes__rotor.stl": "mesh"})
    assert (out / "meshes").is_symlink() and (out / "robot.urdf").is_symlink()
    assert other.read_text() == "new" and tree(meshes) == {"mine.stl": "mine", "rotor.stl": "mesh"}
    assert sorted(p.name for p in out.iterdir()) == ["meshes", "robot.urdf"]


def test_the_current_folder_stays_the_same_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.txt").write_text("mine")
    before = tmp_path.stat().st_ino
    put(Path("."), robot="new", meshes__a="mesh")
    assert tmp_path.stat().st_ino == before
    assert tree(tmp_path) == {"mine.txt": "mine", "robot": "new", "meshes/a": "mesh"}


@pytest.mark.parametrize("kind", ["mount", "simulated mount", "parent without permission"])
def test_a_folder_that_cannot_be_renamed_is_written_file_by_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    """A real tmpfs where mounts are permitted (root); the other two stand for it elsewhere."""
    out = tmp_path / "out"
    out.mkdir()
    mounted = kind == "mount"
    if mounted:
        mount = shutil.which("mount")
        done = mount and subprocess.run(
            [mount, "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(out)], capture_output=True
        )
        if not done or done.returncode:
            pytest.skip("mounts are not permitted here; the simulated ones hold the same")
    elif kind == "simulated mount":
        monkeypatch.setattr(os.path, "ismount", lambda path: Path(path) == out)
        monkeypatch.setattr(folder_swap, "exchange_folder", None)
    else:
        real = os.access
        monkeypatch.setattr(os, "access", lambda p, m: Path(p) != tmp_path and real(p, m))
    try:
        (out / "mine.txt").write_text("mine")
        put(out, robot="new")
        assert tree(out) == {"mine.txt": "mine", "robot": "new"}
        if mounted:
            with pytest.raises(SnakegenError, match=r"^\S*/out: .*No space left on device"):
                put(out, robot="x" * 2_000_000)
            assert tree(out) == {"mine.txt": "mine", "robot": "new"}
    finally:
        if mounted:
            subprocess.run(["umount", str(out)], check=True)
    assert list(tmp_path.iterdir()) == [out]


def test_permissions_are_those_of_the_umask(tmp_path: Path) -> None:
    before = os.umask(0o077)
    try:
        put(tmp_path / "out", robot="x")
    finally:
        os.umask(before)
    assert (tmp_path / "out").stat().st_mode & 0o777 == 0o700
    (tmp_path / "out").chmod(0o750)
    put(tmp_path / "out", robot="y")
    assert (tmp_path / "out").stat().st_mode & 0o777 == 0o750  # of the folder that was there


def test_work_folders_of_killed_builds_are_removed_by_the_next(tmp_path: Path) -> None:
    code = (
        "import sys, time, pathlib; from snakegen.base.atomic_io import folder_whole\n"
        "with folder_whole(pathlib.Path(sys.argv[1])) as folder:\n"
        "    (folder / 'half').write_text('x'); print('there', flush=True); time.sleep(60)"
    )
    target = tmp_path / "out"
    child = subprocess.Popen([sys.executable, "-c", code, str(target)], stdout=subprocess.PIPE)
    assert child.stdout is not None and child.stdout.readline() == b"there\n"
    with pytest.raises(InUseError, match=f"process {child.pid} "):
        put(target, robot="x")
    child.kill()
    child.wait()
    assert len(list(tmp_path.glob(".out.*.work"))) == 1
    put(target, robot="x")
    assert [p.name for p in tmp_path.iterdir()] == ["out"] and tree(target) == {"robot": "x"}


def test_a_folder_is_exchanged_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between the old set and the new there is no instant without one, where the system can."""
    put(tmp_path / "out", robot="old")
    real, seen = os.replace, []
    monkeypatch.setattr(os, "replace", lambda a, b: (seen.append(a), real(a, b)))
    put(tmp_path / "out", robot="new")
    if sys.platform == "linux":
        assert seen == []
    monkeypatch.setattr(folder_swap.ctypes, "CDLL", lambda *_, **__: object())  # no renameat2
    put(tmp_path / "out", robot="newer")
    assert tree(tmp_path / "out") == {"robot": "newer"} and len(list(tmp_path.iterdir())) == 1


def test_a_file_behind_a_link_is_replaced_and_the_link_stays(tmp_path: Path) -> None:
    (tmp_path / "real.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to("real.txt")
    atomic_io.write_atomically(tmp_path / "link.txt", "new")
    assert (tmp_path / "link.txt").is_symlink() and (tmp_path / "real.txt").read_text() == "new"


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EIO])
def test_a_picture_on_a_full_disk_is_one_line_and_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    from matplotlib.figure import Figure

    from snakegen.picture.style import save

    def fails(self: Figure, path: Path, **options: object) -> None:
        Path(path).write_bytes(b"half")
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(Figure, "savefig", fails)
    (tmp_path / "a.png").write_bytes(b"earlier")
    with pytest.raises(SnakegenError, match=f"a.png: cannot be written .{os.strerror(code)}"):
        save(tmp_path / "a.png", (2.0, 2.0), lambda figure: None)
    assert tree(tmp_path) == {"a.png": "earlier"}


def test_threads_that_write_the_same_file_do_not_mix(tmp_path: Path) -> None:
    import threading

    def write(text: str) -> None:
        for _ in range(50):
            replace_whole(tmp_path / "f", lambda part: part.write_text(text * 1000))

    threads = [threading.Thread(target=write, args=(letter,)) for letter in "ab"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert set((tmp_path / "f").read_text()) in ({"a"}, {"b"}) and len(tree(tmp_path)) == 1


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a,a,b\n0,0,0\n", "names 'a' twice"),
        ("a,b\ntrue,0\nfalse,0\n", "line 2: a is 'true', not a finite"),
        ("a,b\nx,0\n", "line 2: a is 'x', not a finite"),
        ("a,b\n2026-01-01,0\n", "line 2: a is '2026-01-01', not"),
    ],
)
def test_columns_that_are_no_angles_are_refused(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(AnalysisError, match=says):
        read_postures(path, ("a", "b"), np.full(2, -1.0), np.full(2, 1.0))


def test_the_lock_of_a_name_without_flock_is_its_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """File systems without locks: the process that the file names decides, while it runs."""
    from snakegen.base import file_lock

    monkeypatch.setattr(file_lock, "fcntl", None)
    target = tmp_path / "f"
    with (
        exclusive(target),
        pytest.raises(InUseError, match="is writing it since"),
        exclusive(target),
    ):
        pass
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    host = file_lock.socket.gethostname()
    file_lock.lock_of(target).write_text(f'{{"pid": {gone.pid}, "host": "{host}"}}')
    with exclusive(target):
        pass
    assert list(tmp_path.iterdir()) == []


def test_an_error_of_many_files_is_one_line_with_the_name_given(tmp_path: Path) -> None:
    """What copying a tree raises names each file twice; the folder is named as given."""
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    why = "[Errno 28] No space left on device: 'a' -> 'b'"
    with pytest.raises(SnakegenError) as error, folder_whole(tmp_path / "link"):
        raise shutil.Error([("a", "b", why), ("c", "d", why)])
    assert str(error.value) == (
        f"{tmp_path / 'link'}: cannot be written (No space left on device)."
    )


def test_a_lock_on_a_full_disk_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "pwrite", full)
    with pytest.raises(SnakegenError, match="No space left"), exclusive(tmp_path / "f.rrd"):
        pass
    assert not list(tmp_path.iterdir())


def test_parts_of_killed_processes_are_removed_by_the_next(tmp_path: Path) -> None:
    """Those of processes that live stay: they will get their name."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    dead = tmp_path / f".f.rrd.{ended.pid}.7f00.part"
    others = [
        tmp_path / f".f.rrd.{os.getppid()}.7f00.part",
        tmp_path / f".g.rrd.{ended.pid}.1.part",
    ]
    for path in (dead, *others):
        path.write_bytes(b"half")
    replace_whole(tmp_path / "f.rrd", lambda beside: beside.write_bytes(b"whole"))
    assert not dead.exists() and all(path.exists() for path in others)
    assert (tmp_path / "f.rrd").read_bytes() == b"whole"
