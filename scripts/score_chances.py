"""Are probabilities of a diagnosis right as often as they say, and what is named by mistake?

    python scripts/score_chances.py --twins 100 --json twins.jsonl     one to four effects
    python scripts/score_chances.py --nulls 30 --json nulls.jsonl      none, of each kind of noise
    python scripts/score_chances.py --summary twins.jsonl nulls.jsonl --picture reliability.svg

MuJoCo is the truth. Effects are drawn with sizes log-uniform from 0.3 to 10 times the size that
is visible: that at which an effect alone, beside nothing, lowers chi2 by 25. The noise is white,
goes together along runs (AR(1) of 0.8), has heavy tails (Student's t with three degrees of
freedom, scaled to the same quartiles), or throws one row in ten far off; nobody tells the
diagnosis which. A statement is a class of effects that these data cannot tell apart, with its
probability; it is true where a hidden effect is in it.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.diagnosis.verdict import diagnose
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import derivatives, evaluate
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.twin.hidden import choose, times
from crosscheck.twin.lab import random_of, sweeps
from crosscheck.twin.measure import Truth, measure
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.description.shipped import model_path
from seecr.effects import Term, Terms
from seecr.pose import quat_from_rotvec, quat_multiply

Array = NDArray[np.float64]
ROBOTS = ("demobot_cogiro", "demobot_parallel")
VISIBLE, SIZES, LARGEST = 25.0, (0.3, 10.0), 3.0
# A name is owed where the effect lowers chi2 by so much beside the others.
OWED = 25.0
BINS = (0.0, 0.05, 0.2, 0.5, 0.8, 0.97, 1.0)


def white(random: np.random.Generator, n: int, width: int, runs: NDArray[Any]) -> Array:
    return random.standard_normal((n, width))


def alike(random: np.random.Generator, n: int, width: int, runs: NDArray[Any]) -> Array:
    """Goes together along runs."""
    out = random.standard_normal((n, width))
    for k in range(1, n):
        if runs[k] == runs[k - 1]:
            out[k] = 0.8 * out[k - 1] + 0.6 * out[k]
    return out


def tails(random: np.random.Generator, n: int, width: int, runs: NDArray[Any]) -> Array:
    """Student's t of three, its quartiles those of a normal one."""
    return random.standard_t(3, (n, width)) * (0.6745 / 0.7649)


def outliers(random: np.random.Generator, n: int, width: int, runs: NDArray[Any]) -> Array:
    """One row in ten is off by about ten times the noise."""
    out = random.standard_normal((n, width))
    far = random.choice(n, n // 10, replace=False)
    out[far] += 10.0 * random.standard_normal((len(far), width))
    return out


NOISES: dict[str, Callable[..., Array]] = {
    "white": white, "alike": alike, "tails": tails, "outliers": outliers,
}  # fmt: skip


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
    anew: dict[str, Any] = dict.fromkeys(
        ("angles_rad", "position_mask", "angle_mask", "tension_mask", "line")
    )
    data = replace(
        case, position=truth.position + sigma.position_m * noise[:, :3], quat_wxyz=quat,
        sigma=sigma, **anew,
    )  # fmt: skip
    return data.rows(truth.at_rest)


def signals(robot: Robot, data: Measurements, hidden: list[Term]) -> Array:
    """(N, k) whitened change of the readings that each effect makes by itself, by SEECR."""
    problem = Problem(robot, data, data.sigma, np.ones(data.n_rows, dtype=bool))
    plain = problem.experiment.predict(())
    factor = problem.noise(plain)
    none = problem.whiten(factor, problem.residuals(plain.readings)[..., None])
    out = [
        problem.whiten(
            factor,
            problem.residuals(problem.experiment.predict([one.effect()]).readings)[..., None],
        )
        - none
        for one in hidden
    ]
    return np.concatenate(out, axis=1) if out else np.zeros((len(none), 0))


def beside(robot: Robot, data: Measurements, hidden: list[Term]) -> list[float]:
    """What each effect takes off chi2 that no values of the others could."""
    if not hidden:
        return []
    problem = Problem(robot, data, data.sigma, np.ones(data.n_rows, dtype=bool))
    terms = Terms(hidden)
    factor = problem.noise(problem.experiment.predict(()))
    rates = derivatives(problem, evaluate(problem, terms, factor)) * terms.scale
    out = []
    for one, signal in zip(hidden, signals(robot, data, hidden).T, strict=True):
        others = np.concatenate(
            [rates[:, ~terms.own(one.name)], 1e-6 * np.eye(len(signal))[:, :1]], axis=1
        )
        u, power, _ = np.linalg.svd(others, full_matrices=False)
        q = u[:, power > 1e-3]
        left = signal - q @ (q.T @ signal)
        out.append(float(left @ left))
    return out


def make(seed: int, count: int, noise: str) -> tuple[Robot, Measurements, list[Term], list[float]]:
    """Robot, measurements, what is hidden, and how much chi2 each owes beside the others."""
    robot = load_robot(model_path(ROBOTS[seed % 2]))
    random = random_of(seed, 5)
    sigma = sigma_of(robot)
    smallest, largest = np.log(SIZES)
    for extent in (0.75, 0.5, 0.35):
        case = sweeps(robot, 18, extent, seed)
        hidden = choose(robot, random_of(seed, 0), None, count)
        # only what could be read decides how large effects are
        exact = measure(robot, case.as_commands(robot), ())
        data = read(case, exact, sigma, np.zeros((case.n_rows, 6)))
        power = np.sum(signals(robot, data, hidden) ** 2, axis=0)
        wanted = np.exp(random.uniform(smallest, largest, len(hidden)))
        grown = np.minimum(wanted * np.sqrt(VISIBLE / np.maximum(power, 1e-12)), LARGEST)
        hidden = [times(one, f) for one, f in zip(hidden, grown, strict=True)]
        truth = measure(robot, case.as_commands(robot), [one.effect() for one in hidden])
        if np.mean(truth.at_rest) > 0.95:
            break
    made = NOISES[noise](random, case.n_rows, 6, case.run)
    data = read(case, truth, sigma, made)
    return robot, data, hidden, beside(robot, data, hidden)


def judged(seed: int, count: int, noise: str) -> dict[str, Any]:
    """One twin made and diagnosed."""
    robot, data, hidden, worth = make(seed, count, noise)
    start = time.process_time()
    found = diagnose(robot, data)
    chances = found.chances
    return {
        "seed": seed,
        "noise": noise,
        "rows": data.n_rows,
        "hidden": {one.name: float(w) for one, w in zip(hidden, worth, strict=True)},
        "verdict": str(found.verdict),
        "named": [[m.effect, *(r.name for r in m.rivals)] for m in found.missing],
        "classes": [] if chances is None else [[list(m), p] for m, p in chances.classes],
        "seconds": time.process_time() - start,
    }


def statements(rows: list[dict[str, Any]]) -> tuple[Array, Array]:
    """Stated probabilities (k,) of classes, and whether each is true, 1 or 0."""
    said = [
        (p, any(h in members for h in row["hidden"]))
        for row in rows
        for members, p in row["classes"]
    ]
    return np.array([s[0] for s in said]), np.array([s[1] for s in said], dtype=float)


def within(p: Array, low: float, high: float) -> NDArray[np.bool_]:
    """(k,) whether probabilities are in a bin; the last one has both its ends."""
    return np.asarray((p >= low) & ((p < high) | (high == 1.0)))


def table(rows: list[dict[str, Any]]) -> list[str]:
    """Reliability of the statements, Brier score, names and verdicts."""
    p, true = statements(rows)
    out = ["| said | statements | mean said | true |", "|---|---|---|---|"]
    for low, high in pairwise(BINS):
        some = within(p, low, high)
        if some.any():
            mean, part = p[some].mean(), true[some].mean()
            out.append(f"| {low:.2f} to {high:.2f} | {some.sum()} | {mean:.3f} | {part:.3f} |")
    if len(p):
        out.append(f"Brier score {np.mean((p - true) ** 2):.4f} over {len(p)} statements")
    named = [(names, row) for row in rows for names in row["named"]]
    false = [(n, r) for n, r in named if not any(h in n for h in r["hidden"])]
    owed = [(h, r) for r in rows for h, w in r["hidden"].items() if w >= OWED]
    got = [1 for h, r in owed if any(h in names for names in r["named"])]
    out.append(
        f"{len(rows)} twins: {len(named)} names, {len(false)} false; of {len(owed)} effects that "
        f"are owed a name {len(got)} have it"
    )
    for names, row in false:
        out.append(f"false: seed {row['seed']} {row['noise']} {'/'.join(names)} {row['hidden']}")
    for noise in NOISES:
        with_it = [row for row in rows if row["noise"] == noise]
        counts = Counter((len(row["hidden"]) > 0, row["verdict"]) for row in with_it)
        for (any_, verdict), n in sorted(counts.items()):
            out.append(f"{noise}, {'effects' if any_ else 'nothing'} hidden: {verdict} {n}")
    spent = sorted(row["seconds"] for row in rows)
    if spent:
        out.append(f"CPU seconds: median {np.median(spent):.1f}, longest {spent[-1]:.1f}")
    return out


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """How often statements are true against how often they say so, with intervals of 95 %."""
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt
    from scipy import stats

    p, true = statements(rows)
    figure, axes = plt.subplots(figsize=(5.2, 4.6), layout="constrained")
    axes.plot([0, 100], [0, 100], color="0.6", linestyle=":", label="as often as stated")
    for low, high in pairwise(BINS):
        some = within(p, low, high)
        if not some.any():
            continue
        hits = int(true[some].sum())
        edges = stats.binomtest(hits, int(some.sum())).proportion_ci(method="wilson")
        x, y = 100 * p[some].mean(), 100 * true[some].mean()
        axes.plot([x, x], [100 * edges.low, 100 * edges.high], color="#0072B2", linewidth=1.5)
        axes.plot(x, y, "o", color="#0072B2")
        axes.annotate(f"{some.sum()}", (x, y), (8, -4), textcoords="offset points", fontsize=9)
    axes.set(xlabel="stated probability [%]", ylabel="true [% of these statements]",
             xlim=(-3, 112), ylim=(-3, 103), aspect="equal")  # fmt: skip
    axes.legend(loc="upper left")
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--twins", type=int, default=0, help="of one to four effects")
    parser.add_argument("--nulls", type=int, default=0, help="of each kind of noise")
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--json", type=Path, help="append a line for each twin there")
    parser.add_argument("--summary", type=Path, nargs="*", default=[], help="files to sum up")
    parser.add_argument("--picture", type=Path, help="of how often statements are true")
    chosen = parser.parse_args()
    names = list(NOISES)
    seeds = range(chosen.first, chosen.first + chosen.twins)
    todo = [(5000 + s, 1 + s % 4, names[(s // 4) % len(names)]) for s in seeds]
    todo += [
        (9000 + s, 0, noise)
        for s in range(chosen.first, chosen.first + chosen.nulls)
        for noise in names
    ]
    rows = [json.loads(line) for path in chosen.summary for line in path.read_text().splitlines()]
    for one in todo:
        rows.append(judged(*one))
        print(json.dumps({k: v for k, v in rows[-1].items() if k != "classes"}), flush=True)
        if chosen.json:
            with chosen.json.open("a") as out:
                out.write(json.dumps(rows[-1]) + "\n")
    print("\n".join(table(rows)))
    if chosen.picture:
        draw(rows, chosen.picture)


if __name__ == "__main__":
    main()
