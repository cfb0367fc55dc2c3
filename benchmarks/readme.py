"""Measures the table of speeds and puts it into docs/speed.md, word for word as it was printed.

python benchmarks/readme.py [SCRIPT…]
"""

import argparse
import subprocess
import sys
from pathlib import Path

SCRIPTS = ("margins.py", "sweep.py", "flight_speed.py", "log.py", "screw.py --only speed")
BEGIN, END = "<!-- speeds: begin -->", "<!-- speeds: end -->"
FOLDER = Path(__file__).parent


def measured(script: str) -> str:
    """Returns what a benchmark prints, under its command."""
    command = f"python benchmarks/{script}"
    print(f"$ {command}", file=sys.stderr)
    words = script.split()
    done = subprocess.run(
        [sys.executable, str(FOLDER / words[0]), *words[1:]],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return f"$ {command}\n{done.stdout.strip()}"


def main() -> None:
    """Replaces what stands between the marks; nothing is written if a benchmark fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scripts", nargs="*", default=SCRIPTS, help="instead of the usual ones")
    parts = [measured(script) for script in parser.parse_args().scripts]
    readme = FOLDER.parent / "docs" / "speed.md"
    text = readme.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    _, found, after = rest.partition(END)
    if not found:
        sys.exit(f"docs/speed.md has no {BEGIN} … {END}")
    table = "\n\n".join(parts)
    readme.write_text(f"{before}{BEGIN}\n```\n{table}\n```\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
