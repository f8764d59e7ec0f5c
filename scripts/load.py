"""Many commands in one folder, one after the other and at once: nothing may be left over.

    python scripts/load.py --count 1000 --at-once 8

Each command is a process of its own, ``seecr pose``, ``sweep`` or ``map``, that writes into the
same folder as the others. Afterwards the folder has the last result's files and nothing else.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import perf_counter

from seecr.folders import MANIFEST

LINE = ["--line", "0.2", "0.25", "0.1", "0.6", "0.25", "0.1", "--count"]
QUIET = ["--figure", "none", "--no-recording"]


def command(k: int, out: Path) -> list[str]:
    """The k-th command: sweeps of 2 to 9 poses."""
    sweep = [sys.executable, "-m", "seecr", "sweep", "demobot_parallel", *LINE, str(2 + k % 8)]
    return [*sweep, "--out", str(out), *QUIET]


def run(count: int, at_once: int, folder: Path) -> tuple[list[str], set[str], set[str]]:
    """How the commands ended, what they left in the folder beside results, and the results."""
    out, beside = folder / "out", os.environ | {"TMPDIR": str(folder / "tmp")}
    (folder / "tmp").mkdir()

    def one(k: int) -> str:
        done = subprocess.run(command(k, out), capture_output=True, env=beside, text=True)
        return " ".join([str(done.returncode), *done.stderr.replace(str(folder), "").split()])

    with ThreadPoolExecutor(at_once) as pool:
        ends = list(pool.map(one, range(count)))
    every = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    results = {f"out/{name}" for name in ("sweep.json", "sweep.csv", MANIFEST)} & every
    folders = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_dir()}
    return ends, (every - results) | (folders - {"out", "tmp"}), results


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--at-once", type=int, default=8)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        start = perf_counter()
        ends, left, results = run(args.count, args.at_once, Path(folder))
        seconds = perf_counter() - start
    print(f"{args.count} commands, {args.at_once} at once, {seconds:.0f} s")
    for end in sorted(set(ends)):
        print(f"  {ends.count(end)} ended {end}")
    print(
        f"results: {', '.join(sorted(results))}; left over: {', '.join(sorted(left)) or 'nothing'}"
    )


if __name__ == "__main__":
    main()
