"""``python -m snakegen`` is the command line."""

from snakegen.cli import main

if __name__ == "__main__":
    main()
