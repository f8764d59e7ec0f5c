"""How good is the diagnosis? Cases that nobody tuned to, all from one seed, into one file.

    python scripts/score.py --out docs/figures.json            everything, half an hour on two
    python scripts/score.py --short                            a tenth of it, and nothing is written
    python scripts/score.py --kinds nulls unknown --json c.jsonl  some kinds, each case as a line
    python scripts/score.py --summary c.jsonl                  the figures of cases made before
    python scripts/score.py --short --move SURE=0.975          with one number that steers moved

MuJoCo is the truth, on the shipped robots. The kinds:

- ``sized``: one effect of 3, 5, 8 or 12 sigma, sqrt(chi2) of what it does to the readings;
- ``several``: two to four effects, log-uniform from 3 to 50 sigma each;
- ``nulls``: nothing, under noise that is white, autocorrelated (0.8), heavy-tailed, has outliers,
  is stated 3.5 times too small, twice too large, or not at all;
- ``unknown``: eight effects that no catalogue has, 3 to 30 times the noise, half of them beside a
  known one;
- ``tolerances``: twelve effects at once of 0.7 expected sizes, and another trajectory.

An effect is owed a name from 5 sigma on beside the others, which no values of these could imitate.
Something unknown is counted by what it does that no effect that acts at once could imitate.
A name is false where neither it nor what cannot be told from it is hidden.
"""

from __future__ import annotations

import argparse
import json
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.calibration import calibrate
from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.fit.problem import Problem, rms_by_kind
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.fit.state import derivatives, evaluate
from crosscheck.inference import priors
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.twin.hidden import choose, times
from crosscheck.twin.lab import random_of, sweeps
from crosscheck.twin.measure import Truth, measure
from seecr.commands import Commands, Loads
from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.effects import Term, Terms, effect_named, layout_of
from seecr.pose import quat_from_rotvec, quat_multiply

Array = NDArray[np.float64]
ROBOTS = ("demobot_cogiro", "demobot_parallel", "cogiro_large", "demobot_uneven")
BEGIN, END = "<!-- figures: make score -->", "<!-- end of the figures -->"
# [s of processor] What MuJoCo does not settle by then is left out: laws with history, small steps.
LONGEST_S = 60.0
SIZES, OWED = (3.0, 5.0, 8.0, 12.0), 5.0
EFFECTS = (
    "cable_length_offset", "initial_pose_error", "drum_gain", "length_scale", "backlash",
    "pulley_radius", "exit_point_error", "anchor_point_error", "stiffness", "cable_stiffness",
    "nonlinear_elasticity", "winch_side_length", "hysteresis", "exit_friction",
    "frame_compliance", "platform_mass", "centre_of_mass", "external_wrench", "gravity_tilt",
    "tracker_frame", "tracker_target", "tracker_scale",
)  # fmt: skip
# Effects with history or shapes.
LATE = ("backlash", "hysteresis", "exit_friction", "nonlinear_elasticity", "winch_side_length")
TOLERANCES = (
    "pulley_radius", "exit_point_error", "anchor_point_error", "cable_length_offset", "drum_gain",
    "tracker_frame", "tracker_target", "platform_mass", "centre_of_mass", "gravity_tilt",
    "cable_stiffness", "initial_pose_error",
)  # fmt: skip
BINS = (0.0, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 1.0)
# Rows of a long sweep; a two-sided interval of 95 %.
POINTS, INTERVAL = 18, 1.96


# --- noise ----------------------------------------------------------------------------------------


def white(random: np.random.Generator, n: int, runs: NDArray[Any]) -> Array:
    """Normal, each reading by itself."""
    return random.standard_normal((n, 6))


def autocorrelated(random: np.random.Generator, n: int, runs: NDArray[Any]) -> Array:
    out = random.standard_normal((n, 6))
    for k in range(1, n):
        if runs[k] == runs[k - 1]:
            out[k] = 0.8 * out[k - 1] + 0.6 * out[k]
    return out


def heavy_tailed(random: np.random.Generator, n: int, runs: NDArray[Any]) -> Array:
    """Student's t of three, its quartiles those of a normal one."""
    return random.standard_t(3, (n, 6)) * (0.6745 / 0.7649)


def outlying(random: np.random.Generator, n: int, runs: NDArray[Any]) -> Array:
    """One row in twenty is off by about ten times the noise."""
    out = random.standard_normal((n, 6))
    far = random.choice(n, n // 20, replace=False)
    out[far] += 10.0 * random.standard_normal((len(far), 6))
    return out


NOISES: dict[str, Callable[..., Array]] = {
    "white": white, "autocorrelated": autocorrelated, "heavy_tailed": heavy_tailed,
    "outliers": outlying,
}  # fmt: skip
STATED = {"too_small": 1.0 / 3.5, "too_large": 2.0, "not_stated": 0.0}


def sigma_of(robot: Robot) -> Sigma:
    """A good tracker: 6e-5 of the mean cable, 0.02 degrees."""
    length = float(np.mean(robot.nominal_lengths(robot.reference_pose[None])))
    return Sigma(position_m=6e-5 * length, orientation_rad=3.5e-4)


def read(case: Measurements, truth: Truth, sigma: Sigma, noise: Array) -> Measurements:
    """What a tracker reads of the rows that rest."""
    assert sigma.position_m is not None and sigma.orientation_rad is not None
    turn = quat_from_rotvec(sigma.orientation_rad * noise[:, 3:])
    quat = quat_multiply(turn, truth.quat_wxyz)
    quat *= np.where(quat[:, :1] < 0.0, -1.0, 1.0)
    anew: dict[str, Any] = dict.fromkeys(("angles_rad", "line"))
    position = truth.position + sigma.position_m * noise[:, :3]
    data = replace(case, position=position, quat_wxyz=quat, sigma=sigma, **anew)
    return data.rows(truth.at_rest)


def stated_as(data: Measurements, factor: float) -> Measurements:
    """The same, its noise stated so many times what it is; 0: not at all."""
    s = data.sigma
    assert s.position_m is not None and s.orientation_rad is not None
    if not factor:
        return replace(data, sigma=Sigma())
    return replace(data, sigma=Sigma(factor * s.position_m, factor * s.orientation_rad))


# --- unknown effects ------------------------------------------------------------------------------


def crosstalk(robot: Robot, told: Commands, size: float) -> Commands:
    """Each winch turns a little with its neighbour."""
    zero = robot.commanded_lengths(robot.reference_pose[None])
    change = robot.commanded_lengths(told.pose) - zero
    return _lengthened(robot, told, 2.0 * size / robot.length * np.roll(change, 1, axis=1))


def edge(robot: Robot, told: Commands, size: float) -> Commands:
    """A cable is bent over an edge on one side of the room: it is too short there."""
    x = told.pose[:, 0]
    more = np.zeros((len(told), robot.n_cables))
    more[:, 1] = 20.0 * size * np.maximum(x - np.median(x), 0.0) / np.ptp(x)
    return _lengthened(robot, told, more)


def hose(robot: Robot, told: Commands, size: float) -> Commands:
    """A soft spring between the platform and a point of the room pulls it."""
    away = (told.pose[:, :3] - told.pose[0, :3]) / robot.length - np.array([0.3, 0.0, 0.0])
    force = -200.0 * robot.mass * 9.81 * size / robot.length * away
    return replace(told, loads=Loads.of(len(told), wrench=np.hstack([force, 0.0 * force])))


def _lengthened(robot: Robot, told: Commands, more: Array) -> Commands:
    lengths = robot.commanded_lengths(told.pose) + more
    return replace(told, lengths=lengths, told=True, passed=None)


def lens(_robot: Robot, data: Measurements, off: Array, size: float) -> Measurements:
    """The tracker's picture bends to one side."""
    return _moved(data, 2.0 * size * off[:, [1]] ** 2 * np.array([1.0, 0.0, 0.5]))


def radial(_robot: Robot, data: Measurements, off: Array, size: float) -> Measurements:
    """It widens towards its edges."""
    return _moved(data, 2.0 * size * off * (off**2).sum(axis=1, keepdims=True))


def drift(_robot: Robot, data: Measurements, off: Array, size: float) -> Measurements:
    """It moves through the session."""
    return _moved(data, 2.0 * size * np.linspace(0, 1, len(off))[:, None] * np.array([0.8, 0.6, 0]))


def wave(_robot: Robot, data: Measurements, off: Array, size: float) -> Measurements:
    """It reads a wave over the room."""
    return _moved(data, size * np.sin(6.0 * off[:, [0]]) * np.array([0.0, 1.0, 0.0]))


def yaw(robot: Robot, data: Measurements, off: Array, size: float) -> Measurements:
    """Its orientation goes with the place."""
    assert data.quat_wxyz is not None
    turn = 12.0 * size / robot.length * np.outer(off[:, 0] * off[:, 1], [0.0, 0.0, 1.0])
    return replace(data, quat_wxyz=quat_multiply(quat_from_rotvec(turn), data.quat_wxyz))


def _moved(data: Measurements, by: Array) -> Measurements:
    return replace(data, position=data.position + by)


MOVING: dict[str, Callable[[Robot, Commands, float], Commands]] = {
    "crosstalk": crosstalk, "edge": edge, "hose": hose,
}  # fmt: skip
SEEN: dict[str, Callable[[Robot, Measurements, Array, float], Measurements]] = {
    "lens": lens, "radial": radial, "drift": drift, "wave": wave, "yaw": yaw,
}  # fmt: skip
UNKNOWN = (*MOVING, *SEEN)


# --- cases ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Task:
    """One case to make: its kind, its seed, and what is particular about it."""

    kind: str
    seed: int
    what: str = ""
    size: float = 0.0
    moved: tuple[str, float] | None = None


@dataclass(frozen=True, eq=False)
class Case:
    """A case that was made: who, what is hidden, what was read, and on another trajectory.

    ``beyond`` is sqrt(chi2) of what something unknown does beyond all effects.
    """

    robot: Robot
    hidden: list[Term]
    data: Measurements
    unknown: str = ""
    other: Measurements | None = None
    beyond: float = 0.0


def tasks(part: float, seed: int, kinds: list[str]) -> list[Task]:
    """All cases of these kinds, or a part of them; ``seed`` sets them all."""

    def some(n: int) -> range:
        return range(seed * 10_000, seed * 10_000 + max(1, round(part * n)))

    every = {
        "sized": [Task("sized", 100 * s + k, name, size) for s in some(2)
                  for k, name in enumerate(EFFECTS) for size in SIZES],
        "several": [Task("several", s, size=2 + s % 3) for s in some(45)],
        "nulls": [Task("nulls", s, noise) for s in some(8) for noise in (*NOISES, *STATED)],
        "unknown": [Task("unknown", s, UNKNOWN[s % len(UNKNOWN)]) for s in some(40)],
        "tolerances": [Task("tolerances", s) for s in some(12)],
    }  # fmt: skip
    if part < 1.0:
        every["sized"] = every["sized"][:: round(1 / part)] if part else every["sized"]
    return [task for kind in kinds for task in every[kind]]


def made(task: Task) -> Case:
    """A case, on commands that MuJoCo finds rest at."""
    draw = random_of(task.seed, 9)
    robot = load_robot(model_path(ROBOTS[draw.integers(len(ROBOTS))]))
    sigma, random = sigma_of(robot), random_of(task.seed, 5)
    for extent in (0.75, 0.5, 0.35):
        rows = sweeps(robot, POINTS, extent, task.seed)
        case = _made(task, robot, rows, sigma, random, 0.8 * extent)
        if case.data.n_rows > 0.95 * rows.n_rows:
            break
    return case


def _made(
    task: Task, robot: Robot, rows: Measurements, sigma: Sigma, random: np.random.Generator,
    elsewhere: float,
) -> Case:  # fmt: skip
    told, n = rows.as_commands(robot), rows.n_rows
    noise: Callable[..., Array] = NOISES.get(task.what, white)
    if task.kind not in ("nulls", "sized"):
        noise = list(NOISES.values())[random_of(task.seed, 11).integers(len(NOISES))]
    if task.kind == "unknown":
        return _with_unknown(task, robot, rows, sigma, noise(random, n, rows.run))
    hidden = _hidden(task, robot, rows, sigma, random)
    acting = list(Terms(hidden).effects)
    data = read(rows, measure(robot, told, acting), sigma, noise(random, n, rows.run))
    other = None
    if task.kind == "tolerances":
        others = sweeps(robot, 7, elsewhere, task.seed + 1)
        there = measure(robot, others.as_commands(robot), acting)
        other = read(others, there, sigma, random.standard_normal((others.n_rows, 6)))
    if task.what in STATED:
        data = stated_as(data, STATED[task.what])
    return Case(robot, hidden, data, other=other)


def _with_unknown(
    task: Task, robot: Robot, rows: Measurements, sigma: Sigma, noise: Array
) -> Case:  # fmt: skip
    """A case with something unknown, half of them beside a known effect."""
    assert sigma.position_m is not None
    draw, told = random_of(task.seed, 7), rows.as_commands(robot)
    size = float(np.exp(draw.uniform(np.log(3.0), np.log(30.0)))) * sigma.position_m
    hidden = choose(robot, random_of(task.seed, 3), None, 1) if draw.integers(2) else []
    acting = list(Terms(hidden).effects)
    moved = MOVING[task.what](robot, told, size) if task.what in MOVING else told
    usual, truth = measure(robot, told, acting), measure(robot, moved, acting)
    rest = usual.at_rest & truth.at_rest
    usual, truth = replace(usual, at_rest=rest), replace(truth, at_rest=rest)

    def seen(truth: Truth, noise: Array) -> Measurements:
        data = read(rows, truth, sigma, noise)
        if task.what not in SEEN or truth is usual:
            return data
        off = data.position - np.nanmean(data.position, axis=0)
        off = off / np.nanmax(np.linalg.norm(off, axis=1))
        return SEEN[task.what](robot, data, off, size)

    if task.what in SEEN:
        truth = replace(truth)
    far = beyond(robot, seen(usual, 0.0 * noise), seen(truth, 0.0 * noise), hidden)
    return Case(robot, hidden, seen(truth, noise), task.what, beyond=far)


def beyond(
    robot: Robot, usual: Measurements, other: Measurements, hidden: list[Term]
) -> float:  # fmt: skip
    """sqrt(chi2) of a change of readings that effects of expected sizes cannot imitate."""
    problem, changed = (
        Problem(robot, data, data.sigma, np.ones(data.n_rows, dtype=bool))
        for data in (usual, other)
    )
    plain = problem.experiment.predict(list(Terms(hidden).effects))
    factor = problem.noise(plain)
    before, after = (
        one.whiten(factor, one.residuals(plain.readings)[..., None])[:, 0]
        for one in (problem, changed)
    )
    at_once = [n for n in EFFECTS if n not in LATE]
    terms = Terms([Term(layout, layout.null) for layout in (layout_of(n, robot) for n in at_once)])
    rates = derivatives(problem, evaluate(problem, terms, factor)) * terms.scale
    left = after - before
    inner = rates.T @ rates + np.eye(rates.shape[1])
    left = left - rates @ np.linalg.solve(inner, rates.T @ left)
    return float(np.linalg.norm(left))


def _hidden(
    task: Task, robot: Robot, rows: Measurements, sigma: Sigma, random: np.random.Generator
) -> list[Term]:
    """What is hidden, at the size that is asked for."""
    if task.kind == "nulls":
        return []
    if task.kind == "tolerances":
        out = []
        for name in TOLERANCES:
            layout = layout_of(name, robot)
            size = 0.7 * layout.scale * random.standard_normal(len(layout))
            size = np.abs(size) if name == "pulley_radius" else size
            out.append(Term(layout, np.clip(layout.null + size, layout.lower, layout.upper)))
        return out
    names = [task.what] if task.kind == "sized" else None
    hidden = choose(robot, random_of(task.seed, 0), names, len(names) if names else int(task.size))
    exact = read(
        rows, measure(robot, rows.as_commands(robot), ()), sigma, np.zeros((rows.n_rows, 6))
    )
    wanted = (
        [task.size] if names else np.exp(random.uniform(np.log(3.0), np.log(50.0), len(hidden)))
    )
    for _ in range(2):  # what an effect does need not grow with its values
        power = np.sum(signals(robot, exact, hidden) ** 2, axis=0)
        factors = np.asarray(wanted) / np.sqrt(np.maximum(power, 1e-12))
        hidden = [times(one, f) for one, f in zip(hidden, factors, strict=True)]
    return hidden


def signals(robot: Robot, data: Measurements, hidden: list[Term]) -> Array:
    """(N, k) whitened change of the readings that each effect makes by itself, by SEECR."""
    problem = Problem(robot, data, data.sigma, np.ones(data.n_rows, dtype=bool))
    plain = problem.experiment.predict(())
    factor = problem.noise(plain)

    def white_of(effects: list[Any]) -> Array:
        raw = problem.residuals(problem.experiment.predict(effects).readings)
        return problem.whiten(factor, raw[..., None])

    none = white_of([])
    every = [white_of([one.effect()]) - none for one in hidden]
    return np.concatenate(every, axis=1) if every else np.zeros((len(none), 0))


def beside(robot: Robot, data: Measurements, hidden: list[Term]) -> list[float]:
    """sqrt(chi2) of what each effect does that no values of the others could."""
    if not hidden:
        return []
    problem = Problem(robot, data, sigma_of(robot), np.ones(data.n_rows, dtype=bool))
    terms = Terms(hidden)
    factor = problem.noise(problem.experiment.predict(()))
    rates = derivatives(problem, evaluate(problem, terms, factor)) * terms.scale
    out = []
    for one, own in zip(
        hidden, signals(robot, replace(data, sigma=sigma_of(robot)), hidden).T, strict=True
    ):
        others = rates[:, ~terms.own(one.name)]
        u, power, _ = np.linalg.svd(others, full_matrices=False)
        q = u[:, power > 1e-3]
        left = own - q @ (q.T @ own)
        out.append(float(np.sqrt(left @ left)))
    return out


# --- what is said of a case -----------------------------------------------------------------------


def judged(task: Task) -> dict[str, Any]:
    """A case made and diagnosed, as a line."""
    if task.moved is not None:
        move(*task.moved)
    with limited(LONGEST_S) as settled:
        case = made(task)
    if not settled:
        return {"kind": task.kind, "seed": task.seed, "what": task.what, "left_out": True}
    start = time.process_time()
    found = diagnose(case.robot, case.data)
    spent = time.process_time() - start
    worth = beside(case.robot, case.data, case.hidden) if task.kind != "tolerances" else []
    hidden = {one.name: one for one in case.hidden}
    fitted = [
        [one.effect, float(hidden[one.effect].vector[k]), float(value), float(error)]
        for one in found.missing if one.effect in hidden and not one.per
        for k, (value, error) in enumerate(zip(one.values, one.stderr, strict=True))
        if np.isfinite(error) and error > 0.0 and not one.layout.shape[k]
    ]  # fmt: skip
    chances = found.chances
    row: dict[str, Any] = {
        "kind": task.kind, "seed": task.seed, "what": task.what, "size": task.size,
        "rows": case.data.n_rows, "robot": case.robot.name, "unknown": case.unknown,
        "hidden": {n: w for n, w in zip(hidden, worth, strict=False)} or dict.fromkeys(hidden, 0.0),
        "parameters": {n: int(np.sum(~t.layout.shape)) for n, t in hidden.items()},
        "verdict": str(found.verdict),
        "named": [[m.effect, *(r.name for r in m.rivals)] for m in found.missing],
        "classes": [] if chances is None else [[list(m), p] for m, p in chances.classes],
        "p_unknown": None if chances is None else chances.unknown,
        "fitted": fitted, "seconds": round(spent, 2), "beyond": case.beyond,
    }  # fmt: skip
    if case.other is not None:
        row["elsewhere"] = _elsewhere(case, found.verdict, found.terms)
    return row


@contextmanager
def limited(seconds: float) -> Iterator[list[bool]]:
    """Give up what takes longer; the list has an item if it was done in time."""
    done: list[bool] = []

    def give_up(_signal: int, _frame: object) -> None:
        raise TimeoutError

    signal.signal(signal.SIGVTALRM, give_up)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield done
        done.append(True)
    except TimeoutError:
        pass
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)


def _elsewhere(case: Case, verdict: DiagnosisVerdict, terms: Terms) -> dict[str, float]:
    """Errors of the model found on another trajectory, over those of the true model."""
    assert case.other is not None
    if verdict is DiagnosisVerdict.MANY_EFFECTS:
        terms = calibrate(case.robot, case.data).terms

    def errors(model: Terms) -> dict[str, float]:
        assert case.other is not None
        problem = Problem(
            case.robot, case.other, case.other.sigma, np.ones(case.other.n_rows, bool)
        )
        factor = problem.noise(problem.experiment.predict(model.effects))
        rms = rms_by_kind(problem, evaluate(problem, model, factor).raw)
        return {key: value for key, value in rms.items() if value is not None}

    true, got = errors(Terms(case.hidden)), errors(terms)
    return {key: round(got[key] / true[key], 3) for key in true}


def move(name: str, value: float) -> None:
    """Move one of the numbers that steer, everywhere it has been imported."""
    import sys

    for module in list(sys.modules.values()):
        own = getattr(module, "__name__", "").startswith("crosscheck.")
        same = own and getattr(module, name, None) == getattr(priors, name)
        if same and module is not priors:
            setattr(module, name, value)
    setattr(priors, name, value)


# --- figures --------------------------------------------------------------------------------------


def true_names(row: dict[str, Any]) -> set[str]:
    """What is hidden, and what it contains: friction is on a cable behind the exit point."""
    inner = {effect_named(name).parent for name in row["hidden"]}
    return set(row["hidden"]) | (inner - {""})


def is_named(row: dict[str, Any], name: str) -> bool:
    """Whether an effect is listed: itself, what it contains, or what cannot be told from it."""
    own = {name, effect_named(name).parent} - {""}
    return any(own & set(names) for names in row["named"])


def false_names(row: dict[str, Any]) -> list[str]:
    """Names that neither are hidden nor stand for what is."""
    return [names[0] for names in row["named"] if not set(names) & true_names(row)]


def figures(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """What docs/figures.json has of the diagnosis."""
    late = sum(row.get("left_out", False) for row in rows)
    rows = [row for row in rows if not row.get("left_out")]
    names = [(row, one) for row in rows for one in row["named"]]
    false = sum(len(false_names(row)) for row in rows)
    seconds = [row["seconds"] for row in rows] or [0.0]
    return {
        "cases": len(rows), "left_out": late, "names": len(names), "false_names": false,
        "false_by_kind": {k: sum(len(false_names(r)) for r in rows if r["kind"] == k)
                          for k in dict.fromkeys(r["kind"] for r in rows)},
        "named_by_size": _named_by_size(rows),
        "several": _several(rows),
        "reliability": _reliability(rows),
        "intervals": _intervals(rows),
        "nulls": _counts(rows, "nulls", "what"),
        "unknown": _counts(rows, "unknown", "unknown"),
        "unknown_by_size": _unknown_by_size(rows),
        "tolerances": _tolerances(rows),
        "seconds": {"median": float(np.median(seconds)), "largest": float(np.max(seconds))},
    }  # fmt: skip


def _named_by_size(rows: list[dict[str, Any]]) -> dict[str, dict[str, list[int]]]:
    """[named, all] by number of parameters and size in sigma."""
    out: dict[str, dict[str, list[int]]] = {}
    for row in rows:
        if row["kind"] != "sized" or not row["hidden"]:
            continue
        (name,) = row["hidden"]
        count = row["parameters"][name]
        group = "1 to 3" if count <= 3 else "4 to 8" if count <= 8 else "more"
        cell = out.setdefault(group, {}).setdefault(f"{row['size']:g}", [0, 0])
        cell[0] += is_named(row, name)
        cell[1] += 1
    return out


def _several(rows: list[dict[str, Any]]) -> dict[str, int]:
    some = [row for row in rows if row["kind"] == "several"]
    owed = [(h, r) for r in some for h, w in r["hidden"].items() if w >= OWED]
    got = sum(is_named(r, h) for h, r in owed)
    right = sum(r["verdict"] == "effects_found" for r in some)
    return {"cases": len(some), "owed": len(owed), "named": got, "effects_found": right}


def _reliability(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """How often classes are true, by stated probability; not where something unknown is hidden."""
    known = [row for row in rows if not row["unknown"]]
    said = [
        (p, any(h in members for h in row["hidden"]))
        for row in known
        for members, p in row["classes"]
    ]
    p, true = np.array([s[0] for s in said]), np.array([s[1] for s in said], float)
    if not len(p):
        return {}
    bins = []
    for low, high in pairwise(BINS):
        some = (p >= low) & ((p < high) | (high == 1.0))
        if some.any():
            bins.append(
                [low, high, int(some.sum()), float(p[some].mean()), float(true[some].mean())]
            )
    truth = [max((q for m, q in row["classes"] if h in m), default=0.0)
             for row in known for h, w in row["hidden"].items() if w >= OWED]  # fmt: skip
    return {
        "bins": bins, "brier": float(np.mean((p - true) ** 2)), "statements": len(p),
        "mean_probability_of_the_truth": float(np.mean(truth)) if truth else None,
    }  # fmt: skip


def _intervals(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Part of the intervals of 95 % that hold the truth, and its standard error, twin by twin."""
    inside = [
        (abs(value - truth) <= INTERVAL * error, f"{row['kind']}{row['seed']}")
        for row in rows if row["verdict"] == "effects_found" and not row["unknown"]
        for _name, truth, value, error in row["fitted"]
    ]  # fmt: skip
    if not inside:
        return {}
    share = float(np.mean([a for a, _ in inside]))
    sums: dict[str, float] = {}
    for a, twin in inside:
        sums[twin] = sums.get(twin, 0.0) + (a - share)
    error = float(np.sqrt(sum(s * s for s in sums.values()))) / len(inside)
    return {"share": share, "stderr": error, "count": len(inside)}


def _counts(rows: list[dict[str, Any]], kind: str, by: str) -> dict[str, dict[str, int]]:
    out: dict[str, dict[str, int]] = {}
    for row in rows:
        if row["kind"] == kind:
            cell = out.setdefault(row[by], {})
            verdict = row["verdict"] + (" with a false name" if false_names(row) else "")
            cell[verdict] = cell.get(verdict, 0) + 1
    return out


def _unknown_by_size(rows: list[dict[str, Any]]) -> dict[str, list[int]]:
    """[unknown_effect, all] by sqrt(chi2) of what no known effect could imitate."""
    out = dict[str, list[int]]()
    for low, high in pairwise((0.0, 5.0, 10.0, 20.0, np.inf)):
        some = [r for r in rows if r["kind"] == "unknown" and low <= r["beyond"] < high]
        said = sum(r["verdict"] == "unknown_effect" for r in some)
        out[f"{low:g} to {high:g}" if high < np.inf else f"from {low:g}"] = [said, len(some)]
    return out


def _tolerances(rows: list[dict[str, Any]]) -> dict[str, Any]:
    some = [row for row in rows if row["kind"] == "tolerances"]
    worst = [max(row["elsewhere"].values()) for row in some if row.get("elsewhere")]
    return {
        "cases": len(some), "many_effects": sum(r["verdict"] == "many_effects" for r in some),
        "error_ratio_elsewhere":
            {"median": float(np.median(worst)), "largest": float(np.max(worst))} if worst else {},
    }  # fmt: skip


# --- the page -------------------------------------------------------------------------------------


def page_of(found: dict[str, Any]) -> str:
    """The figures as docs/diagnosis.md has them."""
    parts = [
        f"{found['cases']} cases by `make score` (seed {found['seed']}, commit {found['commit']}); "
        f"left out: {found['left_out']}, which MuJoCo took over a minute to settle.",
        _sizes_table(found["named_by_size"]),
        _sentences(found),
        _words_table("nothing is missing; the noise is", found["nulls"]),
        _words_table("something unknown is there", found["unknown"]),
        "Called unknown, by what it does that no effect that acts at once could imitate: "
        + ", ".join(
            f"{n} of {m} {'' if size.startswith('from') else 'at '}{size} σ"
            for size, (n, m) in found["unknown_by_size"].items()
            if m
        )
        + ".",
    ]
    return "\n\n".join(parts)


def _sizes_table(named: dict[str, dict[str, list[int]]]) -> str:
    sizes = [f"{size:g}" for size in SIZES]
    head = f"| parameters of the effect | {' | '.join(f'{size} σ' for size in sizes)} |"
    rows = [
        f"| {group} | " + " | ".join(" of ".join(map(str, cells[s])) for s in sizes) + " |"
        for group, cells in sorted(named.items()) if set(sizes) <= set(cells)
    ]  # fmt: skip
    return "\n".join(["Named, of effects that are there alone:", "", head,
                      "|---" * (len(sizes) + 1) + "|", *rows])  # fmt: skip


def _sentences(found: dict[str, Any]) -> str:
    several, told, held = found["several"], found["reliability"], found["intervals"]
    ratio = found["tolerances"]["error_ratio_elsewhere"]
    where = ", ".join(f"{n} in {kind}" for kind, n in found["false_by_kind"].items() if n)
    lines = [
        f"**False names:** {found['false_names']} of {found['names']}"
        f"{f' ({where})' if where else ''}.",
        f"**Two to four effects at once:** {several['named']} of {several['owed']} that are owed a "
        f"name have it; {several['effects_found']} of {several['cases']} cases are "
        "`effects_found`.",
        f"**All tolerances a little off:** {found['tolerances']['many_effects']} of "
        f"{found['tolerances']['cases']} are `many_effects`. On another trajectory the calibrated "
        f"model's worst reading has {ratio['median']:.2f} times the error of the true model in the "
        f"median, {ratio['largest']:.2f} times at most.",
        f"**Intervals of 95 %** hold {100 * held['share']:.1f} ± {100 * held['stderr']:.1f} % of "
        f"{held['count']} values.",
        f"**Probabilities:** the Brier score is {told['brier']:.4f} over {told['statements']} "
        f"statements; the mean probability of what is there is "
        f"{told['mean_probability_of_the_truth']:.2f}.",
        f"**Time:** {found['seconds']['median']:.1f} s of one processor in the median, "
        f"{found['seconds']['largest']:.0f} s at most.",
    ]
    table = ["| stated probability | statements | mean stated | part true |", "|---|---|---|---|"]
    table += [
        f"| {low:.2f} to {high:.2f} | {count} | {mean:.3f} | {true:.3f} |"
        for low, high, count, mean, true in told["bins"]
    ]
    return "\n".join([*(f"- {line}" for line in lines), "", *table])


def _words_table(what: str, counts: dict[str, dict[str, int]]) -> str:
    words = list(dict.fromkeys(word for cell in counts.values() for word in cell))
    head = f"| {what} | {' | '.join(f'`{word}`' for word in words)} |"
    rows = [
        f"| {kind.replace('_', ' ')} | {' | '.join(str(cell.get(w, 0)) for w in words)} |"
        for kind, cell in counts.items()
    ]
    return "\n".join([head, "|---" * (len(words) + 1) + "|", *rows])


def write_page(path: Path, found: dict[str, Any]) -> None:
    """Put the figures between their marks in a page."""
    first, rest = path.read_text(encoding="utf-8").split(f"{BEGIN}\n", 1)
    _old, last = rest.split(END, 1)
    path.write_text(f"{first}{BEGIN}\n{page_of(found)}\n{END}{last}", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    every = ("sized", "several", "nulls", "unknown", "tolerances")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--short", action="store_true", help="a tenth of the cases")
    parser.add_argument("--kinds", nargs="+", choices=every, default=list(every))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--json", type=Path, help="append a line for each case there")
    parser.add_argument("--summary", type=Path, nargs="*", default=[], help="files to sum up")
    parser.add_argument("--out", type=Path, help="write the figures there, under 'diagnosis'")
    parser.add_argument("--page", type=Path, help="write the figures of --out there, as tables")
    parser.add_argument("--move", metavar="NAME=VALUE", help="one number of priors.py, moved")
    chosen = parser.parse_args()
    rows = [json.loads(line) for path in chosen.summary for line in path.read_text().splitlines()]
    moved = None
    if chosen.move:
        name, _, value = chosen.move.partition("=")
        moved = (name, float(value))
    todo = [] if chosen.summary else tasks(0.1 if chosen.short else 1.0, chosen.seed, chosen.kinds)
    with ProcessPoolExecutor(chosen.workers) as pool:
        for row in pool.map(judged, [replace(task, moved=moved) for task in todo]):
            rows.append(row)
            words = ("kind", "seed", "what", "verdict", "named", "seconds")
            print(*(row.get(word, "left out") for word in words), flush=True)
            if chosen.json:
                with chosen.json.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
    found = figures(rows)
    print(json.dumps(found, indent=1))
    if chosen.out:
        commit = subprocess.run(
            ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
        )
        whole = json.loads(chosen.out.read_text()) if chosen.out.exists() else {}
        whole["diagnosis"] = {"commit": commit.stdout.strip(), "seed": chosen.seed, **found}
        chosen.out.write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
        if chosen.page:
            write_page(chosen.page, whole["diagnosis"])


if __name__ == "__main__":
    main()
