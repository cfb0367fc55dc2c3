"""Times every command of a tutorial, in order, in an empty folder and with an empty kernel cache.

    python benchmarks/tutorial.py [docs/tutorials/own-robot.md ...]

What a person reads and types comes on top.
"""

import argparse
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path

BOX = re.compile(r"```console\n(.*?)```", re.S)
FILE = re.compile(r"`([\w-]+\.(?:yaml|urdf))`[^`]*?:\n\n```(?:yaml|xml)\n(.*?)```", re.S)


def commands(text: str) -> list[str]:
    """Returns the commands of a page's console boxes, without those that install."""
    lines = [line for box in BOX.findall(text) for line in re.findall(r"^\$ (.*)$", box, re.M)]
    return [line.partition("#")[0].strip() for line in lines if not line.startswith("pip ")]


def run(page: Path) -> float:
    """Runs a page's commands; returns the time of all [s]."""
    text, total = page.read_text(encoding="utf-8"), 0.0
    print(f"\n{page}, {len(text.split())} words")
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as cache:
        for name, content in FILE.findall(text):
            (Path(folder) / name).write_text(content, encoding="utf-8")
        surroundings = {**os.environ, "SNAKEGEN_CACHE_DIR": cache}
        for line in commands(text):
            words = shlex.split(line)
            start = time.perf_counter()
            done = subprocess.run(
                [sys.executable, "-m", *words], cwd=folder, env=surroundings, capture_output=True
            )
            seconds = time.perf_counter() - start
            total += seconds
            print(f"{seconds:7.1f} s  exit {done.returncode}  {line}", flush=True)
    print(f"{total:7.1f} s  in all", flush=True)
    return total


def main() -> None:
    """Runs the tutorials that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("pages", nargs="*", type=Path)
    pages = parser.parse_args().pages or sorted(Path("docs/tutorials").glob("*.md"))
    for page in pages:
        run(page)


if __name__ == "__main__":
    main()
