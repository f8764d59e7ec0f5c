"""What would explain figure 12: single effects and pairs of them against the text's two numbers.

    python scripts/explain_figure_12.py     the tables and the picture of docs/paper.md, minutes

The text says of the parallel configuration "approximately 20°" of tilt and "about 15 mm" of
deviation along z at both ends. The paper's equations give another pair of numbers. For each effect
of the catalogue, and each two of them, the sizes are sought that come nearest to both while staying
plausible. Two parameters more than numbers always fit; what counts is by how many expected sizes
they have to be off.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import make_paper
import numpy as np
from matplotlib.patches import Rectangle

from seecr.commands import Commands
from seecr.effects import Effect, Layout, catalogue, layout_of
from seecr.pose import Array, pose_difference
from seecr.prediction.experiment import Experiment, read
from seecr.show.colours import COLOURS
from seecr.show.figures import figure

MEASURED, ABOUT = np.array([20.0, -15.0]), np.array([2.0, 3.0])
"""Tilt at the ends [deg] and deviation along z [mm], and what "about" is taken to mean."""

# The corner of that box which is nearest to the plain robot, and how near to come to it.
_AIM, _NEAR = MEASURED + ABOUT, 0.1 * ABOUT
# Expected sizes here, where they are not the catalogue's: a centre of mass that nobody gives, in a
# platform 36 mm high; a target anywhere on it; a platform placed by hand.
_SIZES = {
    "centre_of_mass": {"shift": 0.01},
    "tracker_target": {"shift": 0.05},
    "initial_pose_error": {"position": 0.005, "rotation": 0.05},
}
# Effects that these two numbers cannot be of: tensions were not read, and no temperatures.
_UNSEEN = ("tension_scale", "thermal_expansion")
_ROUNDS, _STEP = 12, 1e-3
_PLAUSIBLE = 2.0
# Points of a curve up to half of that: a few are drawn as kinks that no curve has.
_SAMPLES = 60
# The paper's equations miss by this; what is no nearer is not worth a line.
_FAR = 1.9
# The four ends: left and right at z = 0.1 m, then at 0.2 m.
EVERY = (0, 1, 2, 3)
# Which of them one placing by hand may be of: a sweep through both ends, or one to each.
RUNS = {
    "both ends, z 0.1 m": (0, 1),
    "both ends, z 0.2 m": (2, 3),
    "left end, z 0.1 m": (0,),
    "left end, z 0.2 m": (2,),
}
HEAD_PLACED = "| one run | effects | tilt | along z | expected sizes | largest parameter |"
HEAD = "| effects | tilt | along z | [expected sizes](glossary.md) | largest parameter |"


@dataclass(frozen=True, eq=False)
class Explanation:
    """What some effects come to.

    Attributes:
        names: of the effects.
        numbers: (2,) as :data:`MEASURED`.
        size: root of the sum of squares of the parameters over their expected sizes.
        largest: the parameter that is furthest from null, for people.
        at: the parameters less null, over their expected sizes.
    """

    names: tuple[str, ...]
    numbers: Array
    size: float
    largest: str
    at: Array

    @property
    def nearness(self) -> float:
        """How far the numbers are from their margins, over these; 0 within."""
        over = np.abs(self.numbers - MEASURED) / ABOUT
        return float(np.linalg.norm(np.maximum(over - 1.0, 0.0)))

    def row(self) -> tuple[str, ...]:
        """A line of the page."""
        tilt, along = self.numbers
        names = ", ".join(f"`{name}`" for name in self.names)
        return names, f"{tilt:.1f}°", f"{along:.1f} mm", f"{self.size:.1f}", f"`{self.largest}`"

    @property
    def explains(self) -> bool:
        """Both numbers within their margins, with no more than twice an expected size."""
        within = np.all(np.abs(self.numbers - MEASURED) <= ABOUT + _NEAR)
        return bool(within and self.size <= _PLAUSIBLE)


@cache
def experiment(ends: tuple[int, ...] = EVERY) -> Experiment:
    """Both ends at both heights, each from the reference pose; Vectran. Or some of the four."""
    robot = make_paper.robot("demobot_parallel")
    poses = np.tile(robot.reference_pose, (4, 1))
    poses[:, 0], poses[:, 2] = [0.17, 0.63, 0.17, 0.63], [0.1, 0.1, 0.2, 0.2]
    runs = np.arange(len(ends))
    return Experiment(robot, Commands(poses[list(ends)], run=runs, time=60.0 * runs.astype(float)))


@cache
def layout(name: str) -> Layout:
    return layout_of(catalogue()[name], experiment().robot)


@cache
def scale(name: str) -> Array:
    """Expected sizes of an effect's parameters."""
    own = layout(name).scale.copy()
    for part, size in _SIZES.get(name, {}).items():
        own[[key.startswith(part) for key in layout(name).names]] = size
    return own


def numbers(effects: Sequence[Effect], ends: tuple[int, ...] = EVERY) -> Array:
    """Tilt and deviation along z at the ends, as read by a tracker set up on a level platform."""
    one = experiment(ends).predict(effects)
    commands = one.setup.commands.pose
    level = read(effects, one.setup, commands, one.tensions)
    poses, origin = (
        np.concatenate([reading.position, reading.quat_wxyz], axis=1)
        for reading in (one.readings, level)
    )
    if not (one.solved | one.singular).all():
        return np.full(2, np.nan)
    moved = pose_difference(poses, origin)
    tilts = np.degrees(moved[:, 4]) * np.array([1.0, -1.0, 1.0, -1.0])[list(ends)]
    return np.array([tilts.mean(), 1e3 * moved[:, 2].mean()])


def of_all(names: tuple[str, ...], part: Callable[[str], Array]) -> Array:
    """What each effect's parameters have, one after the other."""
    return np.concatenate([part(name) for name in names])


def placing(names: tuple[str, ...], some: tuple[int, ...] = EVERY) -> Callable[[Array], Array]:
    """Both numbers by the parameters less null over their expected sizes."""
    null = of_all(names, lambda name: layout(name).null)
    unit = of_all(names, scale)
    ends = np.cumsum([len(layout(name)) for name in names])[:-1]

    def at(x: Array) -> Array:
        vectors = np.split(null + unit * x, ends)
        effects = [layout(name).build(v) for name, v in zip(names, vectors, strict=True)]
        return numbers(effects, some)

    return at


def explain(names: tuple[str, ...], some: tuple[int, ...] = EVERY) -> Explanation:
    """The sizes that come nearest to both numbers and stay plausible: damped Gauss-Newton."""
    null = of_all(names, lambda name: layout(name).null)
    low = of_all(names, lambda name: layout(name).lower)
    high = of_all(names, lambda name: layout(name).upper)
    unit = of_all(names, scale)
    low, high = (low - null) / unit, (high - null) / unit
    at = placing(names, some)

    def cost(x: Array, there: Array) -> float:
        return float(np.sum(((there - _AIM) / _NEAR) ** 2) + x @ x)

    x = np.clip(np.zeros(len(null)), low, high)
    now = at(x)
    for _ in range(_ROUNDS):
        # inwards where a bound is near
        steps = np.where(x + _STEP <= high, _STEP, -_STEP)
        slopes = np.column_stack(
            [(at(x + step * axis) - now) / step for step, axis in zip(steps, np.eye(len(x)),
             strict=True)]
        )  # fmt: skip
        slopes = np.nan_to_num(slopes) / _NEAR[:, None]
        miss = (_AIM - now) / _NEAR + slopes @ x
        goal = slopes.T @ np.linalg.solve(slopes @ slopes.T + np.eye(2), miss)
        for part in 0.5 ** np.arange(8):
            trial = np.clip(x + part * (goal - x), low, high)
            there = at(trial)
            if cost(trial, there) < cost(x, now) - 1e-9:
                break
        else:
            break
        x, now = trial, there
    keys = [f"{name}.{key}" for name in names for key in layout(name).names]
    k = int(np.argmax(np.abs(x)))
    largest = f"{keys[k]} = {(null + unit * x)[k]:.3g}"
    return Explanation(names, now, float(np.linalg.norm(x)), largest, x)


def candidates() -> list[str]:
    """Effects that these numbers can be of."""
    return [name for name in catalogue() if name not in _UNSEEN]


def rows(singles: Sequence[Explanation], pairs: Sequence[Explanation]) -> Iterator[tuple[str, ...]]:
    """Effects, tilt, deviation, size, the parameter that is furthest off: the nearest first."""
    plain = numbers([])
    yield "none", f"{plain[0]:.1f}°", f"{plain[1]:.1f} mm", "", ""
    moved = [one for one in singles if one.size <= _PLAUSIBLE and one.nearness < _FAR]
    for one in sorted(moved, key=lambda one: one.nearness):
        yield one.row()
    for one in sorted((pair for pair in pairs if pair.explains), key=lambda one: one.size):
        yield one.row()


def placed() -> Iterator[tuple[str, ...]]:
    """The placing by hand of each run by itself, alone and with what else takes tilt away.

    Runs have values of their own. The right ends are the left ones' mirror images.
    """
    for words, ends in RUNS.items():
        for names in (("initial_pose_error",), ("initial_pose_error", "centre_of_mass")):
            yield words, *explain(names, ends).row()


def summary(singles: Sequence[Explanation], pairs: Sequence[Explanation]) -> str:
    """One sentence."""
    count = {n: sum(one.explains for one in some) for n, some in ((1, singles), (2, pairs))}
    return (
        f"Of {len(singles)} effects {count[1] or 'none'}, and of their {len(pairs)} pairs "
        f"{count[2]}, bring both numbers within their margins with at most {_PLAUSIBLE:g} "
        "expected sizes."
    )


def picture(path: Path, singles: Sequence[Explanation]) -> None:
    """Where effects bring both numbers, from nothing to twice an expected size."""
    moved = [one for one in singles if one.size <= _PLAUSIBLE and one.nearness < _FAR]
    with figure(path, 1, 1, figsize=(7.4, 4.6)) as axes:
        ax = axes[0, 0]
        low = MEASURED - ABOUT
        ax.add_patch(Rectangle(tuple(low), *(2.0 * ABOUT), color="#009E73", alpha=0.2, lw=0))
        words = "what the text says\nwas measured, “about”"
        ax.annotate(words, (low[0] + 0.1, low[1] + 0.2), fontsize=8)
        for colour, one in zip(COLOURS, moved, strict=False):
            place = placing(one.names)
            sizes = np.linspace(0.0, _PLAUSIBLE, 2 * _SAMPLES + 1)
            way = np.array([place(size * one.at / one.size) for size in sizes])
            ax.plot(*way.T, color=colour, label=one.names[0].replace("_", " "))
            ax.plot(*way[_SAMPLES::_SAMPLES].T, "o", color=colour, markersize=4.5)
        ax.plot(*numbers([]), "*", color="black", markersize=11, label="the paper's equations")
        ax.set(xlabel="tilt at the ends [°]", ylabel="deviation along z at the ends [mm]")
        ax.set(xlim=(17.5, 27.5), ylim=(-20.0, -5.0))
        ax.set_title("dots: one and two expected sizes")
        ax.legend(fontsize=8, loc="lower right")


def main() -> None:
    """Write the table and the picture of docs/paper.md."""
    singles = [explain((name,)) for name in candidates()]
    pairs = [explain(pair) for pair in itertools.combinations(candidates(), 2)]
    picture(make_paper.PICTURES / "figure-12-explained.png", singles)
    page = make_paper.PAGE.read_text(encoding="utf-8")
    page = make_paper.with_table(page, "explanations", HEAD, rows(singles, pairs))
    page = make_paper.with_table(page, "placed runs", HEAD_PLACED, placed())
    make_paper.PAGE.write_text(page, encoding="utf-8")
    print(summary(singles, pairs))


if __name__ == "__main__":
    main()
