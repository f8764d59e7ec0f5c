"""Where boxes on floors go, so that the lines between them cross little.

Sugiyama's way (Sugiyama, Tagawa, Toda 1981): a line that passes a floor gets a narrow place there
as if it were a box; floors are sorted by the mean place of their neighbours, down and up in turn;
then everything is pulled over its neighbours as far as the boxes beside it allow. No random
numbers: the same boxes and lines give the same drawing.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

Point = tuple[float, float]

_SWEEPS, _PULLS = 40, 60
_LINE = 6.0  # width of a line's place on a floor that it passes [pixels]


@dataclass(frozen=True)
class Layout:
    """Places of boxes and lines, from the upper left corner, y downwards [pixels].

    Attributes:
        width: of the whole.
        height: of the whole.
        middle: of each box.
        ways: of each line, from the lower edge of a box through every floor it passes.
    """

    width: float
    height: float
    middle: dict[str, Point]
    ways: list[list[Point]]


@dataclass
class _Grid:
    """Floors from above, with the places of passing lines among them.

    Attributes:
        rows: names on each floor, from left to right.
        links: between neighbouring floors, upper and lower name.
        chains: each line as the names from its upper to its lower box.
        widths: of every place [pixels].
    """

    rows: list[list[str]]
    links: list[tuple[str, str]]
    chains: list[list[str]]
    widths: dict[str, float]

    def neighbours(self) -> dict[str, list[str]]:
        """Names that a name is linked with, on the floors above and below."""
        found: dict[str, list[str]] = {name: [] for row in self.rows for name in row}
        for upper, lower in self.links:
            found[upper].append(lower)
            found[lower].append(upper)
        return found


def arrange(
    rows: Sequence[Sequence[str]],
    lines: Mapping[str, frozenset[str]],
    sizes: Mapping[str, Point],
    gap: float,
    space: float,
) -> Layout:
    """Place boxes.

    Args:
        rows: names of the boxes, floor by floor from above.
        lines: from each box to boxes on floors below.
        sizes: width and height of each box [pixels].
        gap: least space between boxes [pixels].
        space: between a floor's lower edge and the next one's upper edge [pixels].
    """
    grid = _grid(rows, lines, sizes)
    _sort(grid)
    x = _pulled(grid, gap)
    left = min(x[n] - grid.widths[n] / 2 for n in x)
    x = {name: at - left for name, at in x.items()}
    edges = _edges(grid, sizes, space)
    y = [(upper + lower) / 2 for upper, lower in edges]
    middle = {name: (x[name], y[k]) for k, row in enumerate(rows) for name in row}
    ways = [_way(chain, x, edges, middle, sizes) for chain in grid.chains]
    width = max(x[n] + grid.widths[n] / 2 for n in x)
    return Layout(width, edges[-1][1], middle, ways)


def _grid(
    rows: Sequence[Sequence[str]], lines: Mapping[str, frozenset[str]], sizes: Mapping[str, Point]
) -> _Grid:
    floor = {name: k for k, row in enumerate(rows) for name in row}
    grid = _Grid([list(row) for row in rows], [], [], {n: sizes[n][0] for n in floor})
    for upper in sorted(lines):
        for lower in sorted(lines[upper]):
            passing = [f"{upper}|{lower}|{k}" for k in range(floor[upper] + 1, floor[lower])]
            for k, name in enumerate(passing, floor[upper] + 1):
                grid.rows[k].append(name)
                grid.widths[name] = _LINE
            chain = [upper, *passing, lower]
            grid.chains.append(chain)
            grid.links += itertools.pairwise(chain)
    return grid


def _crossings(grid: _Grid) -> int:
    """How often links cross."""
    place = {name: k for row in grid.rows for k, name in enumerate(row)}
    count = 0
    for row in grid.rows[:-1]:
        here = set(row)
        ends = sorted((place[a], place[b]) for a, b in grid.links if a in here)
        lower = [b for _, b in ends]
        count += sum(lower[i] > b for k, b in enumerate(lower) for i in range(k))
    return count


def _sort(grid: _Grid) -> None:
    """Sort each floor by the mean place of its neighbours; the order with fewest crossings."""
    above: dict[str, list[str]] = {name: [] for row in grid.rows for name in row}
    below: dict[str, list[str]] = {name: [] for row in grid.rows for name in row}
    for upper, lower in grid.links:
        above[lower].append(upper)
        below[upper].append(lower)
    best, fewest = [list(row) for row in grid.rows], _crossings(grid)
    for sweep in range(_SWEEPS):
        down = sweep % 2 == 0
        for row in grid.rows if down else grid.rows[::-1]:
            place = {n: (k + 0.5) / len(r) for r in grid.rows for k, n in enumerate(r)}
            beside = above if down else below
            row.sort(key=lambda n: _mean([place[b] for b in beside[n]], place[n]))
        if (now := _crossings(grid)) < fewest:
            best, fewest = [list(row) for row in grid.rows], now
    grid.rows[:] = best


def _mean(values: Sequence[float], otherwise: float) -> float:
    return sum(values) / len(values) if values else otherwise


def _pulled(grid: _Grid, gap: float) -> dict[str, float]:
    """Middles [pixels]: each pulled over its neighbours, in order and without touching.

    Pulling may drift: boxes that push one another apart go on doing so. The round with the shortest
    lines counts.
    """
    x: dict[str, float] = {}
    for row in grid.rows:
        at = 0.0
        for name in row:
            x[name] = at + grid.widths[name] / 2
            at += grid.widths[name] + gap
        for name in row:
            x[name] -= at / 2
    neighbours = grid.neighbours()
    best, shortest = dict(x), math.inf
    for _ in range(_PULLS):
        for row in grid.rows:
            wanted = [_mean([x[b] for b in neighbours[n]], x[n]) for n in row]
            for name, at in zip(row, _apart(row, wanted, grid.widths, gap), strict=True):
                x[name] = at
        length = sum(abs(x[a] - x[b]) for a, b in grid.links)
        if length < shortest:
            best, shortest = dict(x), length
    return best


def _apart(
    row: Sequence[str], wanted: Sequence[float], widths: Mapping[str, float], gap: float
) -> list[float]:
    """Places nearest to the wanted ones that keep order and space: mean of two greedy passes."""

    def pushed(names: Sequence[str], goals: Sequence[float]) -> list[float]:
        out: list[float] = []
        for k, (name, goal) in enumerate(zip(names, goals, strict=True)):
            if k:
                space = (widths[names[k - 1]] + widths[name]) / 2 + gap
                goal = max(goal, out[-1] + space)
            out.append(goal)
        return out

    right = pushed(row, wanted)
    left = [-at for at in pushed(row[::-1], [-goal for goal in wanted[::-1]])[::-1]]
    return [(a + b) / 2 for a, b in zip(left, right, strict=True)]


def _edges(grid: _Grid, sizes: Mapping[str, Point], space: float) -> list[tuple[float, float]]:
    """Upper and lower edge of each floor [pixels]."""
    edges, at = [], 0.0
    for row in grid.rows:
        tallest = max(sizes[name][1] for name in row if name in sizes)
        edges.append((at, at + tallest))
        at += tallest + space
    return edges


def _way(
    chain: Sequence[str],
    x: Mapping[str, float],
    edges: Sequence[tuple[float, float]],
    middle: Mapping[str, Point],
    sizes: Mapping[str, Point],
) -> list[Point]:
    """From box to box, straight down past the floors between."""
    first, *passing, last = chain
    top, bottom = middle[first], middle[last]
    points = [(top[0], top[1] + sizes[first][1] / 2)]
    for name in passing:
        points += [(x[name], edge) for edge in edges[int(name.rpartition("|")[2])]]
    return [*points, (bottom[0], bottom[1] - sizes[last][1] / 2)]
