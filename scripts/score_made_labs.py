"""Make laboratories on the robots of others, diagnose them, and predict another trajectory.

    python scripts/score_made_labs.py ../shared/data/labs --seeds 0 20 --json made.jsonl
    python scripts/score_made_labs.py ../shared/data/labs --seeds 0 20 --options

MuJoCo is the truth. Robots are taken in turn from the folder's cases, kinds of noise as in
score_chances.py; hidden are two, three or four effects, as a twin draws them, or all tolerances at
once. With --options there are one to three effects, or none, and what is read or stated changes:
positions alone, tensions too, noise stated half or twice as large as it is, or not at all.

Each case is a line: what was hidden and what each effect is worth beside the others (chi2), the
verdict, the names, and the errors of the model that comes of it on another trajectory, over those
of the true model. Where the verdict is many_effects, the model is that of ``calibrate``.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from score_chances import NOISES, beside, read, sigma_of

from crosscheck.calibration.result import calibrate
from crosscheck.diagnosis.verdict import diagnose
from crosscheck.fit.least_squares.problem import Problem, rms_by_kind
from crosscheck.fit.least_squares.state import evaluate
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.twin.hidden import choose
from crosscheck.twin.lab import random_of, sweeps
from crosscheck.twin.measure import Truth, measure
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.effects import Term, Terms, layout_of

CASES = ("B07", "B03", "B02", "B08", "B04", "B09")
LARGE = ("hall", "crane")
TOLERANCES = (
    "pulley_radius", "exit_point_error", "anchor_point_error", "cable_length_offset", "drum_gain",
    "tracker_frame", "tracker_target", "platform_mass", "centre_of_mass", "gravity_tilt",
    "cable_stiffness", "initial_pose_error",
)  # fmt: skip
OPTIONS = ("position", "tensions", "half", "double", "unstated")
# Sizes of all tolerances at once, in plausible ones.
_TOLERANCE = 0.7


def drawn(robot: Robot, seed: int, count: int) -> list[Term]:
    """Effects as a twin draws them; all tolerances where the count is beyond four."""
    if count <= 4:
        return choose(robot, random_of(seed, 0), None, count) if count else []
    random, out = random_of(seed, 7), []
    for name in TOLERANCES:
        layout = layout_of(name, robot)
        size = _TOLERANCE * layout.scale * random.standard_normal(len(layout))
        size = np.abs(size) if name == "pulley_radius" else size
        out.append(Term(layout, np.clip(layout.null + size, layout.lower, layout.upper)))
    return out


def counted(seed: int, options: bool) -> int:
    """How many effects are hidden; five means all tolerances."""
    kind = seed % 4
    if not options:
        return 5 if kind == 3 else kind + 2
    return 0 if seed % 9 == 0 else (5 if kind == 3 else kind + 1)


def with_option(
    data: Measurements, truth: Truth, option: str, random: np.random.Generator
) -> Measurements:
    """The data as read or stated otherwise."""
    sigma = data.sigma
    assert sigma.position_m is not None and sigma.orientation_rad is not None
    if option == "position":
        return replace(data, quat_wxyz=None, sigma=Sigma(position_m=sigma.position_m))
    if option == "tensions":
        tensions = truth.tensions[truth.at_rest]
        noise = 0.02 * float(np.mean(tensions))
        tensions = tensions + noise * random.standard_normal(tensions.shape)
        stated = replace(sigma, tension_N=noise)
        anew: dict[str, Any] = {"tensions": tensions, "tension_mask": None}
        return replace(data, sigma=stated, **anew)
    factor = {"half": 0.5, "double": 2.0}.get(option)
    if factor is None:
        return replace(data, sigma=Sigma())
    stated = Sigma(factor * sigma.position_m, factor * sigma.orientation_rad)
    return replace(data, sigma=stated)


def errors(robot: Robot, data: Measurements, terms: Terms) -> dict[str, float]:
    """Rms errors of a model by kind of reading."""
    problem = Problem(robot, data, data.sigma, np.ones(data.n_rows, dtype=bool))
    factor = problem.noise(problem.experiment.predict(terms.effects))
    rms = rms_by_kind(problem, evaluate(problem, terms, factor).raw)
    return {key: value for key, value in rms.items() if value is not None}


def ratio(of: dict[str, float], to: dict[str, float]) -> dict[str, float]:
    return {key.split("_")[0]: round(of[key] / to[key], 3) for key in of}


def taken(folder: Path, seed: int) -> tuple[Robot, str, str, Sigma]:
    """The robot of a seed, what it is called, the kind of noise and its size."""
    answers = json.loads((folder / "answers.json").read_text(encoding="utf-8"))
    case = CASES[(seed // 2) % len(CASES)]
    who, noise = answers[case]["robot"], list(NOISES)[(seed // 4) % len(NOISES)]
    robot = load_robot(folder / case / "robot.xml")
    sigma = Sigma(position_m=3e-4, orientation_rad=2e-4) if who in LARGE else sigma_of(robot)
    return robot, who, noise, sigma


def judged(folder: Path, seed: int, options: bool) -> dict[str, Any]:
    """One case made, diagnosed, and its model tried elsewhere."""
    robot, who, noise, sigma = taken(folder, seed)
    random = random_of(seed, 11)
    hidden = drawn(robot, seed, counted(seed, options))
    acting = [one.effect() for one in Terms(hidden)]
    for extent in (0.75, 0.5, 0.35):
        rows, other = sweeps(robot, 18, extent, seed), sweeps(robot, 7, 0.8 * extent, seed + 1)
        truth = measure(robot, rows.as_commands(robot), acting)
        there = measure(robot, other.as_commands(robot), acting)
        if truth.at_rest.mean() > 0.95 and there.at_rest.mean() > 0.9:
            break
    runs: NDArray[Any] = rows.run
    whole = read(rows, truth, sigma, NOISES[noise](random, rows.n_rows, 6, runs))
    validation = read(other, there, sigma, random.standard_normal((other.n_rows, 6)))
    option = OPTIONS[seed % len(OPTIONS)] if options else ""
    data = with_option(whole, truth, option, random) if option else whole
    start = time.process_time()
    found = diagnose(robot, data)
    spent = time.process_time() - start
    terms = found.terms
    if found.verdict is DiagnosisVerdict.MANY_EFFECTS:
        terms = Terms(one.term for one in calibrate(robot, data).fitted)
    true = errors(robot, validation, Terms(hidden))
    few = len(hidden) <= 4
    worth = beside(robot, whole, hidden) if few else []
    return {
        "seed": seed, "robot": who, "noise": noise, "option": option,
        "hidden": {h.name: round(w) for h, w in zip(hidden, worth, strict=True)} if few else "all",
        "verdict": str(found.verdict),
        "named": [[m.effect, *(r.name for r in m.rivals)] for m in found.missing],
        "elsewhere": ratio(errors(robot, validation, terms), true),
        "plain": ratio(errors(robot, validation, Terms()), true),
        "seconds": round(spent, 1),
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of laboratories, whose robots are taken")
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 12), help="first, and one beyond")
    parser.add_argument("--options", action="store_true", help="read and state otherwise")
    parser.add_argument("--json", type=Path, help="append a line for each case there")
    chosen = parser.parse_args()
    for seed in range(*chosen.seeds):
        line = json.dumps(judged(chosen.folder, seed, chosen.options))
        print(line, flush=True)
        if chosen.json:
            with chosen.json.open("a", encoding="utf-8") as file:
                file.write(line + "\n")


if __name__ == "__main__":
    main()
