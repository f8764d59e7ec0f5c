"""Many commands in one folder, one after the other and at once: nothing may be left over.

    python scripts/load.py --count 1000 --at-once 8

Each command is a process of its own, ``seecr sweep``, ``seecr map`` or ``crosscheck compare``, that
writes into the same folder as the others. Afterwards the folder has the files of the last result of
each and nothing else.
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

ROBOT = "demobot_parallel"
LINE = ["--line", "0.2", "0.25", "0.1", "0.6", "0.25", "0.1", "--count"]
GRID = ["--grid", "0.3:0.5:3", "0.25", "0.1"]
ROWS = ["cmd_x_m,cmd_y_m,cmd_z_m,meas_x_m,meas_y_m,meas_z_m"]
ROWS += [f"0.{k},0.25,0.1,0.{k}01,0.25,0.1" for k in range(2, 7)]
RESULTS = ("sweep.json", "sweep.csv", "map.npz", "map.json", "comparison.json", "comparison.html")


def command(k: int, folder: Path) -> list[str]:
    """The k-th command: of eight one is a map, one a comparison, and six sweep 2 to 8 poses."""
    quiet = ["--no-recording", "--out", str(folder / "out")]
    if k % 8 == 3:
        return ["seecr", "map", ROBOT, *GRID, "--figure", "none", *quiet]
    if k % 8 == 7:
        return ["crosscheck", "compare", ROBOT, str(folder / "measured.csv"), *quiet]
    return ["seecr", "sweep", ROBOT, *LINE, str(2 + k % 8), "--figure", "none", *quiet]


def run(count: int, at_once: int, folder: Path) -> tuple[list[str], set[str], set[str]]:
    """How the commands ended, what they left in the folder beside results, and the results."""
    beside = os.environ | {"TMPDIR": str(folder / "tmp")}
    (folder / "tmp").mkdir()
    (folder / "measured.csv").write_text("\n".join(ROWS) + "\n")

    def one(k: int) -> str:
        asked = [sys.executable, "-m", *command(k, folder)]
        done = subprocess.run(asked, capture_output=True, env=beside, text=True)
        return " ".join([str(done.returncode), *done.stderr.replace(str(folder), "").split()])

    with ThreadPoolExecutor(at_once) as pool:
        ends = list(pool.map(one, range(count)))
    every = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    results = {f"out/{name}" for name in (*RESULTS, MANIFEST)} & every
    folders = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_dir()}
    left = (every - results - {"measured.csv"}) | (folders - {"out", "tmp"})
    return ends, left, results


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
