"""Diagnose MuJoCo twins whose hidden effects are known, and print the score.

    python scripts/score_twins.py --seeds 1 2 3      each effect on both DemoBots
    python scripts/score_twins.py --pairs 40         two effects at once
    python scripts/score_twins.py --null 50          none

A twin counts where each of its effects moves some reading by more than twice its noise. It is
right where just the hidden effects are named, each itself or as indistinguishable of a listed
one. Of those that are right with every effect named itself: how many parameters are within
three standard errors of the truth, and whether runs left out are predicted within 1.2 times the
noise.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from crosscheck.diagnosis.result import Diagnosis
from crosscheck.diagnosis.verdict import diagnose
from crosscheck.measurements.read import load_measurements
from crosscheck.twin.answer import unseal
from crosscheck.twin.make import make_twin
from seecr.description.mjcf import load_robot
from seecr.description.shipped import model_path
from seecr.effects import BUILT_IN

ROBOTS = ("demobot_cogiro", "demobot_parallel")
CLOSE, FLOOR = 3.0, 1.2


@dataclass(frozen=True)
class Score:
    """How the diagnosis of one twin turned out.

    Attributes:
        kind: "one", "pair" or "null".
        seen: whether each effect moves a reading by more than twice its noise.
        right: whether just the hidden effects were named.
        distances: of parameters from the truth, in standard errors, where all were named.
        over_noise: rms on runs left out over the noise, the larger of position and orientation.
    """

    kind: str
    robot: str
    seed: int
    hidden: list[str]
    verdict: str
    named: list[list[str]]
    seen: bool
    right: bool
    distances: list[float]
    over_noise: float
    seconds: float


def right(found: Diagnosis, hidden: list[str]) -> bool:
    """Whether just the hidden effects are named, each itself or as an equal."""
    named = [{f.effect, *(r.name for r in f.rivals)} for f in found.missing]
    return len(named) == len(hidden) and all(any(h in n for n in named) for h in hidden)


def distances(found: Diagnosis, values: dict[str, dict[str, float]]) -> list[float]:
    """Distances of parameters from the truth, in standard errors; those that the data see."""
    if {f.effect for f in found.missing} != set(values):
        return []
    out = []
    for f in found.missing:
        for name, value, error in zip(f.layout.names, f.values, f.stderr, strict=True):
            truth = values[f.effect].get(name)
            if truth is not None and np.isfinite(error) and error > 0:
                out.append(float(abs(value - truth) / error))
    return out


def over_noise(found: Diagnosis) -> float:
    """Held-out rms over what noise alone would give."""
    names = ("position_rms_m", "orientation_rms_rad")
    shares = [(found.held_out.get(n), found.floor.get(n)) for n in names]
    return max((a / b for a, b in shares if a is not None and b), default=float("nan"))


def score(kind: str, robot: str, seed: int, effects: tuple[str, ...] | None) -> Score:
    """Make, diagnose and judge one twin; ``effects`` None draws two."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "case"
        tensions = effects is not None and "tension_scale" in effects
        path = Path(robot) if robot.endswith(".xml") else model_path(robot)
        make_twin(path, seed, effects=effects, n_effects=2, out=out, tensions=tensions)
        answer = unseal(out)
        machine = load_robot(out / "robot.xml")
        data = load_measurements(out / "measured.csv", machine)
        start = time.perf_counter()
        found = diagnose(machine, data)
        seconds = time.perf_counter() - start
    hidden = answer.hidden
    moves = [one.max for one in answer.moves_over_noise.values()]
    good = right(found, hidden)
    return Score(
        kind, robot, seed, hidden, found.verdict,
        [[f.effect, *(r.name for r in f.rivals)] for f in found.missing],
        not hidden or min(moves, default=0.0) > 2.0, good,
        distances(found, answer.values) if good else [], over_noise(found), seconds,
    )  # fmt: skip


def line(one: Score) -> str:
    """One twin in a line."""
    word = ("right" if one.right else "WRONG") if one.seen else "unseen"
    named = ", ".join("/".join(names) for names in one.named) or "nothing"
    far = f", {max(one.distances):.1f} standard errors" if one.distances else ""
    return (
        f"{word} {one.robot} seed {one.seed} {'+'.join(one.hidden) or 'null'}: {one.verdict}, "
        f"{named}{far}, {one.over_noise:.2f} x noise, {one.seconds:.1f} s"
    )


def summary(scores: list[Score]) -> list[str]:
    """The score, a line for each kind of twin."""
    out = []
    for kind in ("one", "pair", "null"):
        some = [s for s in scores if s.kind == kind and s.seen]
        if not some:
            continue
        good = [s for s in some if s.right]
        far = np.array([d for s in good for d in s.distances])
        held = np.array([s.over_noise for s in good])
        times = np.array([s.seconds for s in some])
        out.append(
            f"{kind}: {len(good)} right of {len(some)} ({len(good) / len(some):.1%}); parameters "
            f"within {CLOSE:g} standard errors: {int((far <= CLOSE).sum())} of {len(far)}; runs "
            f"left out within {FLOOR:g} x noise: {int((held <= FLOOR).sum())} of {len(held)}; "
            f"median {np.median(times):.1f} s, longest {times.max():.1f} s"
        )
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="*", default=[])
    parser.add_argument("--effects", nargs="*", default=[e.name for e in BUILT_IN])
    parser.add_argument("--pairs", type=int, default=0, help="how many twins of two effects")
    parser.add_argument("--null", type=int, default=0, help="how many twins of none")
    parser.add_argument(
        "--robots", nargs="*", default=list(ROBOTS), help="shipped robots, or MJCF files"
    )
    parser.add_argument("--json", type=Path, help="write every twin's score there")
    chosen = parser.parse_args()
    robots = chosen.robots
    todo: list[tuple[str, str, int, tuple[str, ...] | None]] = [
        ("one", robot, seed, (name,))
        for seed in chosen.seeds
        for name in chosen.effects
        for robot in robots
    ]
    todo += [("pair", robots[k % len(robots)], 2000 + k, None) for k in range(chosen.pairs)]
    todo += [("null", robots[k % len(robots)], 1000 + k, ()) for k in range(chosen.null)]
    scores = []
    for one in todo:
        try:
            scores.append(score(*one))
        except Exception as error:
            print(f"failed {one}: {error!r}", flush=True)
            continue
        print(line(scores[-1]), flush=True)
        if chosen.json:
            chosen.json.write_text(json.dumps([asdict(s) for s in scores], indent=1))
    print("\n".join(summary(scores)))


if __name__ == "__main__":
    main()
