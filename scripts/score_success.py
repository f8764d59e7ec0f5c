"""How large must an effect be to be named, and do intervals hold the truth?

    python scripts/score_success.py --json success.jsonl            every effect alone, five sizes
    python scripts/score_success.py --plausible 90 --json more.jsonl  sizes drawn from the prior
    python scripts/score_success.py --summary success.jsonl more.jsonl --picture success.svg

MuJoCo is the truth; a DemoBot's sweeps of 144 rows, a good tracker's noise. Sizes are multiples of
what ``crosscheck plan`` calls the smallest that shows on just these commands. Named is what is
listed, itself or as what these data cannot tell from it.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from score_chances import ROBOTS, read, sigma_of

from crosscheck.diagnosis.verdict import diagnose
from crosscheck.measurements.data import Measurements
from crosscheck.planning.design import make_plan
from crosscheck.planning.result import Visible
from crosscheck.twin.lab import random_of, sweeps
from crosscheck.twin.measure import measure
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.description.shipped import model_path
from seecr.effects import Term

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TIMES = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8)
# These move only what is not read here.
UNREAD = {"tension_scale"}
# A two-sided interval of 95 %.
WIDTH = 1.96


def commands_of(robot: Robot) -> Measurements:
    """Sweeps to and fro that every effect can rest in."""
    return replace(sweeps(robot, 18, 0.5, 1), sigma=sigma_of(robot))


def drawn(robot: Robot, found: Visible, size: float, seed: int) -> Term:
    """The effect with each parameter drawn about so many plausible sizes.

    One parameter has just that size; several are normal ones, scaled to the signal that the plan
    expects of that size.
    """
    layout = found.signal.layout
    random = random_of(seed, 7)
    z = random.standard_normal(len(layout.names))
    z[layout.shape] = 0.0
    columns = found.signal.columns
    z *= np.sqrt(np.sum(columns**2) / max(float(np.sum((columns @ z) ** 2)), 1e-300))
    start = layout.start(found.signal.shape)
    vector = np.where(layout.shape, start, layout.null + size * z * layout.scale)
    mirrored = np.where(layout.shape, start, layout.null - size * z * layout.scale)
    outside = (vector < layout.lower) | (vector > layout.upper)
    vector = np.where(outside, mirrored, vector)
    if not Term(layout, vector).is_possible(robot):  # such as cables that pull less when stretched
        vector = mirrored
    return Term(layout, np.clip(vector, layout.lower, layout.upper))


def judged(robot: Robot, hidden: Term, multiple: float, seed: int) -> dict[str, Any] | None:
    """One effect hidden and looked for; None where MuJoCo finds no rest."""
    case = commands_of(robot)
    truth = measure(robot, case.as_commands(robot), [hidden.effect()])
    if np.mean(truth.at_rest) < 0.95:
        return None
    noise = random_of(seed, 8).standard_normal((case.n_rows, 6))
    data = read(case, truth, sigma_of(robot), noise)
    start = time.process_time()
    found = diagnose(robot, data)
    values = dict(zip(hidden.layout.names, hidden.vector.tolist(), strict=True))
    fitted = [
        [key, values[key], value, error]
        for one in found.missing
        if one.effect == hidden.name
        for key, value, error in zip(one.layout.names, one.values, one.stderr, strict=True)
        if np.isfinite(error) and error > 0.0
    ]
    return {
        "effect": hidden.name,
        "multiple": multiple,
        "seed": seed,
        "verdict": str(found.verdict),
        "named": [[one.effect, *(r.name for r in one.rivals)] for one in found.missing],
        "fitted": fitted,
        "seconds": time.process_time() - start,
    }


def is_named(row: dict[str, Any]) -> bool:
    """Whether what was hidden is listed."""
    return any(row["effect"] in names for names in row["named"])


def is_false(row: dict[str, Any]) -> bool:
    """Whether something is listed that is not there, nor what cannot be told from it."""
    return any(row["effect"] not in names for names in row["named"])


def table(rows: list[dict[str, Any]]) -> list[str]:
    """Part named by size and effect, false names, coverage."""
    sized = [row for row in rows if row["multiple"]]
    out = [
        "| effect | " + " | ".join(f"{m:g}" for m in TIMES) + " |",
        "|---" * (1 + len(TIMES)) + "|",
    ]
    for name in [*sorted({row["effect"] for row in sized}), "all"]:
        cells = []
        for multiple in TIMES:
            some = [r for r in sized if r["multiple"] == multiple and name in (r["effect"], "all")]
            cells.append(f"{sum(map(is_named, some))}/{len(some)}")
        out.append(f"| {name} | " + " | ".join(cells) + " |")
    false = [(r, n) for r in rows for n in r["named"] if r["effect"] not in n]
    out.append(f"{len(rows)} twins, {len(false)} false names")
    out += [f"false: {r['effect']} x {r['multiple']} seed {r['seed']}: {n}" for r, n in false]
    inside = [
        (abs(value - truth) <= WIDTH * error, r["effect"], r["seed"])
        for r in rows
        for _key, truth, value, error in r["fitted"]
    ]
    if inside:
        share, error = clustered([(a, f"{b}{c}") for a, b, c in inside])
        out.append(
            f"{100 * share:.1f} ± {100 * error:.1f} % of {len(inside)} intervals of 95 % hold "
            "the truth"
        )
    return out


def clustered(inside: list[tuple[bool, str]]) -> tuple[float, float]:
    """Part that is true, and its standard error where those of one twin go together."""
    share = float(np.mean([a for a, _ in inside]))
    sums: dict[str, float] = {}
    for a, twin in inside:
        sums[twin] = sums.get(twin, 0.0) + (a - share)
    return share, float(np.sqrt(sum(s * s for s in sums.values()))) / len(inside)


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Part named against size: of all effects together, and of each; false names beside both."""
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    sized = [row for row in rows if row["multiple"]]
    effects = sorted({row["effect"] for row in sized})
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(7.0, 9.6), layout="constrained", height_ratios=[3.0, 7.0]
    )
    _draw_all(above, sized)
    _draw_each(below, sized, effects)
    figure.savefig(path)


def _draw_all(axes: Axes, rows: list[dict[str, Any]]) -> None:
    """Parts of the twins with the right name, and with a false one, over the columns below."""
    from scipy import stats

    series = (
        ("named", is_named, "#0072B2", "o", -0.06),
        ("a false name", is_false, "#D55E00", "s", 0.06),
    )
    for label, counts, colour, marker, aside in series:
        for k, multiple in enumerate(TIMES):
            hits = [counts(r) for r in rows if r["multiple"] == multiple]
            low, high = stats.binomtest(sum(hits), len(hits)).proportion_ci(method="wilson")
            axes.plot([k + aside] * 2, [100 * low, 100 * high], color=colour, linewidth=1.5)
            axes.plot(k + aside, 100 * np.mean(hits), marker, color=colour,
                      label=label if not k else None)  # fmt: skip
    axes.axhline(90.0, color="0.5", linestyle=":", linewidth=1.0)
    axes.set(ylim=(-3, 103), xlim=(-0.5, len(TIMES) - 0.5), ylabel="% of twins (bars: 95 %)")
    axes.set_xticks(range(len(TIMES)), [f"{m:g}" for m in TIMES])
    axes.legend(loc="center right")


def _draw_each(axes: Axes, rows: list[dict[str, Any]], effects: list[str]) -> None:
    """Named of each effect by size, a cell each; a mark where a name was false."""
    part = np.full((len(effects), len(TIMES)), np.nan)
    for i, name in enumerate(effects):
        for k, multiple in enumerate(TIMES):
            some = [r for r in rows if r["effect"] == name and r["multiple"] == multiple]
            if not some:
                continue
            hits, false = sum(map(is_named, some)), sum(map(is_false, some))
            part[i, k] = hits / len(some)
            text = f"{hits}/{len(some)}" + (f"  ({false} false)" if false else "")
            dark = part[i, k] > 0.6
            axes.text(k, i, text, ha="center", va="center", fontsize=8,
                      color="white" if dark else "black")  # fmt: skip
    axes.imshow(part, cmap="Blues", vmin=0.0, vmax=1.2, aspect="auto")
    axes.set_yticks(range(len(effects)), effects, fontsize=9)
    axes.set_xticks(range(len(TIMES)), [f"{m:g}" for m in TIMES])
    axes.set_xlabel("size, in units of the smallest that plan says shows (5 to 7 times the noise)")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=2, help="of each effect and size")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--plausible", type=int, default=0, help="twins of plausible sizes instead")
    parser.add_argument("--robot", choices=ROBOTS, default=ROBOTS[0])
    parser.add_argument("--json", type=Path, help="append a line for each twin there")
    parser.add_argument("--summary", type=Path, nargs="*", default=[], help="files to sum up")
    parser.add_argument("--picture", type=Path, help="of the part named against size")
    chosen = parser.parse_args()
    rows = [json.loads(line) for path in chosen.summary for line in path.read_text().splitlines()]
    for one in [] if chosen.summary else todo(chosen):
        row = judged(*one)
        if row is None:
            continue
        rows.append(row)
        print(json.dumps({k: v for k, v in row.items() if k != "fitted"}), flush=True)
        if chosen.json:
            with chosen.json.open("a") as out:
                out.write(json.dumps(row) + "\n")
    print("\n".join(table(rows)))
    if chosen.picture:
        draw(rows, chosen.picture)


def todo(chosen: argparse.Namespace) -> list[tuple[Robot, Term, float, int]]:
    """Robot, what is hidden, its multiple (0: a plausible size) and seed, one for each twin."""
    robot = load_robot(model_path(chosen.robot))
    plan = make_plan(robot, commands_of(robot))
    seen = [v for v in plan.effects if np.isfinite(v.factor) and v.name not in UNREAD]
    seeds = range(chosen.first, chosen.first + chosen.seeds)
    if chosen.plausible:
        twins = range(chosen.first, chosen.first + chosen.plausible)
        return [(robot, drawn(robot, seen[s % len(seen)], 1.0, s), 0.0, s) for s in twins]
    return [
        (robot, drawn(robot, v, m * v.factor, 100 * s + k), m, 100 * s + k)
        for s in seeds
        for k, v in enumerate(seen)
        for m in TIMES
    ]


if __name__ == "__main__":
    main()
