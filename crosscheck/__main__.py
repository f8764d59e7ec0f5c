"""``python -m crosscheck``: the same as the command ``crosscheck``."""

from __future__ import annotations

from crosscheck.cli import main

if __name__ == "__main__":
    main(prog_name="crosscheck")
