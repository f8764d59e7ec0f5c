"""Diagnose MuJoCo twins with one hidden effect each, and print the score.

    python scripts/score_twins.py --seeds 1 2 3
    python scripts/score_twins.py --null 50

A twin counts where its effect moves some reading by more than twice its noise. It is right
where the effect is named, itself or as indistinguishable of the listed one, and nothing else.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from crosscheck.diagnose import diagnose
from crosscheck.diagnosis import Diagnosis
from crosscheck.measurements import load_measurements
from crosscheck.sealed import unseal
from crosscheck.twin import make_twin
from seecr.effects import BUILT_IN
from seecr.mjcf import load_robot
from seecr.shipped import model_path

ROBOTS = ("demobot_cogiro", "demobot_parallel")


def right(found: Diagnosis, hidden: list[str]) -> bool:
    """Whether just the hidden effects are named, each itself or as an equal."""
    named = [{f.effect, *(r.name for r in f.rivals)} for f in found.missing]
    return len(named) == len(hidden) and all(any(h in n for n in named) for h in hidden)


def worst_error(found: Diagnosis, values: dict[str, dict[str, float]]) -> float:
    """Largest distance of a parameter from the truth, in standard errors."""
    worst = 0.0
    for finding in found.missing:
        for name, value, error in zip(
            finding.layout.names, finding.values, finding.stderr, strict=True
        ):
            truth = values.get(finding.effect, {}).get(name)
            if truth is not None and np.isfinite(error) and error > 0:
                worst = max(worst, abs(value - truth) / error)
    return worst


def one(robot: str, effects: tuple[str, ...], seed: int) -> bool | None:
    """Make, diagnose and judge one twin; None where its effect cannot be seen."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "case"
        tensions = "tension_scale" in effects
        make_twin(model_path(robot), seed, effects=effects, out=out, tensions=tensions)
        answer = unseal(out)
        machine = load_robot(out / "robot.xml")
        data = load_measurements(out / "measured.csv", machine)
        start = time.perf_counter()
        found = diagnose(machine, data)
        seconds = time.perf_counter() - start
    moves = [m["max"] for m in answer.get("moves_over_noise", {}).values()]
    seen = not effects or min(moves, default=0.0) > 2.0
    good = right(found, list(effects))
    word = "right" if good else "WRONG"
    named = [(f.effect, [r.name for r in f.rivals]) for f in found.missing]
    distance = worst_error(found, answer.get("values", {}))
    print(
        f"{word if seen else 'unseen'} {robot} seed {seed} {'+'.join(effects) or 'null'}: "
        f"{found.verdict} {named}, {distance:.1f} standard errors, {seconds:.1f} s",
        flush=True,
    )
    return good if seen else None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="*", default=[])
    parser.add_argument("--null", type=int, default=0, help="how many null twins")
    parser.add_argument("--robots", nargs="*", default=list(ROBOTS))
    chosen = parser.parse_args()
    results = [
        one(robot, (effect.name,), seed)
        for seed in chosen.seeds
        for effect in BUILT_IN
        for robot in chosen.robots
    ]
    results += [
        one(chosen.robots[k % len(chosen.robots)], (), 1000 + k) for k in range(chosen.null)
    ]
    counted = [r for r in results if r is not None]
    print(f"{sum(counted)} right of {len(counted)} that can be seen")


if __name__ == "__main__":
    main()
