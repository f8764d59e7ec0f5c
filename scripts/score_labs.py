"""Calibrate the labelled cases of a folder and say what the models are worth elsewhere.

    python scripts/score_labs.py ../shared/data/labs            all cases
    python scripts/score_labs.py ../shared/data/labs B13 B16    some
    python scripts/score_labs.py --sets ../shared/data/twins    which effects are needed, too

Each case is fitted on measured.csv and predicts validation.csv, another trajectory of the same
robot. Its errors there are printed in units of the noise: 1 is a perfect model.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.calibration.joint_fit.all_effects import Calibration, fit_all_effects
from crosscheck.calibration.search import SetSearch, search_sets
from crosscheck.fit.least_squares.problem import Problem, kinds_read, rms_by_kind
from crosscheck.fit.least_squares.state import State, evaluate
from crosscheck.fit.preparation.prepare import prepare
from crosscheck.measurements.read import load_measurements
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.effects import Terms


def predicted(robot: Robot, path: Path, terms: Terms) -> tuple[Problem, State]:
    """A model on measurements that it was not fitted to."""
    data = load_measurements(path, robot)
    problem = Problem(robot, data, data.sigma, np.ones(data.n_rows, dtype=bool))
    factor = problem.noise(problem.experiment.predict(terms.effects))
    return problem, evaluate(problem, terms, factor)


def shares(problem: Problem, state: State, noise: dict[str, float]) -> dict[str, float]:
    """Errors by kind of reading, in units of the noise."""
    rms = rms_by_kind(problem, state.raw)
    stated = {kind.key: getattr(problem.sigma, kind.sigma) for kind in kinds_read(problem)}
    return {
        key: float(rms[key] or 0.0) / (noise.get(key) or sigma)
        for key, sigma in stated.items()
        if sigma
    }


def noise_in(answer: dict[str, Any]) -> dict[str, float]:
    """The noise that was really put on, as far as the answer says."""
    return {
        "position_rms_m": answer["noise_pos_m"],
        "orientation_rms_rad": answer["noise_rot_rad"],
    }


def line(name: str, answer: dict[str, Any], found: Calibration, folder: Path, spent: float) -> str:
    """One case in a line."""
    robot = found.setting.problem.robot
    problem, state = predicted(robot, folder / "validation.csv", found.terms)
    errors = shares(problem, state, noise_in(answer))
    text = ", ".join(f"{key.split('_')[0]} {share:.3f}" for key, share in errors.items())
    scale, rho = found.colour.scale, found.colour.rho
    late = [
        t.name for t in found.terms
        if t.name in ("hysteresis", "creep", "backlash", "exit_friction", "cable_weight")
        or t.layout.shape.any()
    ]  # fmt: skip
    left_out = float(np.max(found.held_out.surprise))
    fitted = found.joint.state.chi2 / len(found.joint.weight)
    return (
        f"{name} {answer['robot']} {'+'.join(answer['hidden'])} {answer['options']}: {text} "
        f"x noise, chi2/N {state.chi2 / len(state.white):.3f}; fitted {fitted:.3f}, worst run "
        f"left out {left_out:.2f}, noise x {scale.round(2)} rho {rho.round(2)}, "
        f"outliers {int(found.outliers.sum())}, later {late}, {spent:.1f} s"
    )


def verdict_line(
    name: str, answer: dict[str, Any], sought: SetSearch, folder: Path, spent: float
) -> str:
    """What is said to be missing, beside what was hidden."""
    said = sought.judgement
    probable = [
        f"{'/'.join(members)} {p:.2f}"
        for members, p in zip(sought.classes.members, sought.classes.probability, strict=True)
        if p > 0.05
    ]
    best = sought.found.best
    text = ""
    if (folder / "validation.csv").exists():
        robot = sought.calibration.setting.problem.robot
        problem, state = predicted(robot, folder / "validation.csv", best.joint.terms)
        errors = shares(problem, state, noise_in(answer))
        text = "; best set " + ", ".join(f"{k.split('_')[0]} {v:.3f}" for k, v in errors.items())
    return (
        f"    {name} hidden {'+'.join(answer['hidden'])}: {said.verdict.value}, sure "
        f"{', '.join(said.sure) or 'none'}; best {', '.join(sorted(best.names)) or 'none'}; field "
        f"{sought.field_odds:+.1f}, open {said.undecided:.2f}; {', '.join(probable)}{text}; "
        f"{len(sought.found.refits)} sets, {spent:.1f} s"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("cases", nargs="*")
    parser.add_argument("--sets", action="store_true", help="which effects are needed, too")
    chosen = parser.parse_args()
    answers = json.loads((chosen.folder / "answers.json").read_text())
    for name in chosen.cases or sorted(answers):
        folder = chosen.folder / name
        start = time.process_time()
        robot = load_robot(folder / "robot.xml")
        data = load_measurements(folder / "measured.csv", robot)
        ready = prepare(robot, data, Terms())
        if ready.refusal:
            print(f"{name}: {ready.refusal}", flush=True)
            continue
        sought = search_sets(ready.problem, data.sigma) if chosen.sets else None
        found = fit_all_effects(ready.problem) if sought is None else sought.calibration
        spent = time.process_time() - start
        if (folder / "validation.csv").exists():
            print(line(name, answers[name], found, folder, spent), flush=True)
        if sought is not None:
            print(verdict_line(name, answers[name], sought, folder, spent), flush=True)


if __name__ == "__main__":
    main()
