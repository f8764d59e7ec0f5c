"""What moving each number that steers by a factor of two does to labelled cases.

    python scripts/score_moves.py ../shared/data/labs3               all numbers, on all cases
    python scripts/score_moves.py ../shared/data/labs3 SURE UNKNOWN   some numbers
    python scripts/score_moves.py ../shared/data/labs3 --cases D05 R01   on some cases

Probabilities move by odds, ln odds by ln 2, everything else is doubled and halved. A row is a
number: its values, and the cases whose verdict or names change, with what they become. Which of
these are still right, answers.json tells.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from score import move

import crosscheck
from crosscheck.inference import priors

FACTORS = (0.5, 2.0)
LOG_ODDS, CHANCES = ("UNKNOWN", "ANEW"), ("SURE", "SLOW", "MAY_BE_UNKNOWN", "MISJUDGED")


def moved(name: str, factor: float) -> Any:
    """A number of priors.py, larger or smaller by a factor."""
    value = getattr(priors, name)
    if name in LOG_ODDS:
        return value + float(np.log(factor))
    if name in CHANCES:
        odds = factor * value / (1.0 - value)
        return odds / (1.0 + odds)
    if name == "OUTLIERS":  # how many rows are off
        return (1.0 - factor * sum(value[1:]), *(factor * part for part in value[1:]))
    if name == "FAR":
        return (value[0], *(factor * part for part in value[1:]))
    if isinstance(value, tuple):
        return tuple(factor * part for part in value)
    return type(value)(round(factor * value)) if isinstance(value, int) else factor * value


def answers(folder: Path, cases: Sequence[str], name: str, value: Any = None) -> dict[str, str]:
    """The verdict and names of each case, with one number moved."""
    if name:
        move(name, value)
    out = {}
    for case in cases or sorted(json.loads((folder / "answers.json").read_text(encoding="utf-8"))):
        files = [folder / case / file for file in ("measured.csv", "second.csv")]
        data = [file for file in files if file.exists()]
        found = crosscheck.diagnose(folder / case / "robot.xml", data)
        names = ["/".join([m.effect, *m.indistinguishable]) for m in found.missing]
        out[case] = " ".join([found.verdict.value, *names])
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    every = [name for name in vars(priors) if name.isupper()]
    parser.add_argument("names", nargs="*", choices=[[], *every], default=[])
    parser.add_argument("--cases", nargs="+", default=[])
    parser.add_argument("--workers", type=int, default=2)
    chosen = parser.parse_args()
    steps = [(name, moved(name, by)) for name in chosen.names or every for by in FACTORS]
    # a process for each move, which leaves no other number moved
    with ProcessPoolExecutor(chosen.workers, max_tasks_per_child=1) as pool:
        first = pool.submit(answers, chosen.folder, chosen.cases, "")
        later = [pool.submit(answers, chosen.folder, chosen.cases, *step) for step in steps]
        base = first.result()
        for (name, value), found in zip(steps, later, strict=True):
            other = {k: v for k, v in found.result().items() if v != base[k]}
            changed = "; ".join(f"{k}: {base[k]} -> {v}" for k, v in other.items())
            print(f"{name} = {value}: {changed or 'nothing changes'}", flush=True)


if __name__ == "__main__":
    main()
