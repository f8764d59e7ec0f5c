"""Data and a model's errors on every page that has them: facts, map, walls, associations."""

from __future__ import annotations

from collections.abc import Iterable

from crosscheck.comparison.associations import Association
from crosscheck.fit.problem import Problem, kinds_read
from crosscheck.show.blocks import (
    Bar,
    Cell,
    Facts,
    Figure,
    Line,
    Panel,
    TextTable,
    Words,
    pieces,
    section,
)
from crosscheck.show.misfit import Drawn
from seecr.counted import counted
from seecr.description.robot import Robot
from seecr.units import chance, in_unit, short


def title_of(problem: Problem) -> str:
    """The robot and its data."""
    return f"{problem.robot.name} · {problem.data.name}"


def facts_of(problem: Problem, *more: tuple[str, str], noise: str = "noise") -> Facts:
    """What was measured, in a few words, and what else is known.

    Args:
        problem: the data. more: names and values to add. noise: what its stated noise is called.
    """
    data, sigma = problem.data, problem.sigma
    values = {"position": sigma.position_m, "orientation": sigma.orientation_rad,
              "tension": sigma.tension_N}  # fmt: skip
    sizes = [
        f"{kind.name} {short(value * kind.factor, 2)} {kind.unit}"
        for kind in kinds_read(problem)
        if (value := values[kind.name]) is not None
    ]
    if sigma.length_m:
        sizes.append(f"commanded lengths {short(1e3 * sigma.length_m, 2)} mm")
    rows = f"{int(problem.use.sum())}"
    if not problem.use.all():
        rows += f" of {data.n_rows}"
    ways = int((~data.read).sum())
    if ways:
        rows += f", {counted(ways, 'way point')}"
    return Facts(
        [
            ("robot", _robot_words(problem.robot)),
            ("data", data.name),
            ("rows", rows),
            ("runs", str(len(data.runs))),
            ("readings", str(problem.n_readings)),
            (noise, ", ".join(sizes)),
            *more,
        ]
    )


def _robot_words(robot: Robot) -> str:
    passive = f", passive: {', '.join(robot.passive_names)}" if robot.passive_names else ""
    return f"{robot.name}, {counted(robot.n_driven, 'cable')}{passive}"


def map_section(
    title: str, problem: Problem, before: Drawn, after: Drawn, more: str = ""
) -> Panel | None:
    """Where the errors are."""
    from crosscheck.show.error_figures import caption, failure_map

    figure = Figure(failure_map(problem, before, after))
    return section(title, figure, Line(caption(problem, before) + more, "dim"))


def wall_section(
    title: str, problem: Problem, before: Drawn, after: Drawn, alone: str, key: Words = (),
    noise: str = "noise",
) -> Panel | None:  # fmt: skip
    """What the errors of each cable look like, with a key to their colours; ``alone`` is that of
    errors that no effect accounts for.
    """
    from crosscheck.show.error_figures import draw_wall, walls_of

    walls = [Figure(draw_wall(wall, alone)) for wall in walls_of(problem, before, after)]
    words = (
        f"Grey background: two standard deviations of the {noise}. A constant suggests an offset, "
        "a slope over the length a gain, a sine an eccentric drum, a curve over time creep, and a "
        "step between reeled in and paid out friction or backlash."
    )
    hint = Line((*pieces(key), words), "dim")
    return section(title, hint, *walls) if walls else None


def association_section(title: str, rows: Iterable[Association]) -> Panel | None:
    """What errors depend on."""
    some = [_association(row) for row in rows]
    return section(title, Panel("", some, "beside")) if some else None


def _association(row: Association) -> Panel:
    """An association in the units that people read, with a bar for each of its bins."""
    factor, unit = in_unit(row.unit)
    top = max((abs(part.mean) for part in row.bins if part.mean is not None), default=0.0)
    bins: list[list[Cell]] = [
        [
            part.label if len(row.bins) > 1 else "all",
            counted(part.rows, "row"),
            Bar(0.0 if not top or part.mean is None else part.mean / top, middle=True),
            short(None if part.mean is None else factor * part.mean),
        ]
        for part in row.bins
    ]
    words = (
        f"explains {100 * row.share:.0f} % of the variance of the {row.of}, p {chance(row.p)}; "
        f"strongest in {row.strongest} [{unit}]:"
    )
    return Panel(
        str(row.against),
        [Line(words, "dim"), TextTable(["", "#", "", "#"], bins, kind="bins")],
        "part",
    )
