"""``python -m seecr``: the same as the command ``seecr``."""

from __future__ import annotations

from seecr.cli import main

if __name__ == "__main__":
    main(prog_name="seecr")
