"""What all pages have: the template, what was measured, and how each came about."""

from __future__ import annotations

from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from crosscheck.fit.least_squares.problem import Problem, kinds_read
from crosscheck.report.glossary import with_glossary
from seecr import __version__
from seecr.counted import counted
from seecr.files import Made
from seecr.units import short


def page_of(template: str, made: Made | None, **context: Any) -> str:
    """A page's text.

    Args:
        template: its file. made: how it came about. context: what the template asks for.
    """
    environment = Environment(
        loader=PackageLoader("crosscheck.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["counted"] = counted
    said = "" if made is None else made.words
    page = environment.get_template(template).render(version=__version__, made=said, **context)
    return with_glossary(page)


def title_of(problem: Problem) -> str:
    """The robot and its data."""
    return f"{problem.robot.name} · {problem.data.name}"


def facts(problem: Problem, *, other_noise: bool = False) -> list[tuple[str, str]]:
    """What was measured, in a few words.

    Args:
        problem: the data. other_noise: whether noise was found to be other than that assumed.
    """
    data, sigma = problem.data, problem.sigma
    values = {"position": sigma.position_m, "orientation": sigma.orientation_rad,
              "tension": sigma.tension_N}  # fmt: skip
    noise = [
        f"{kind.name} {short(value * kind.factor, 2)} {kind.unit}"
        for kind in kinds_read(problem)
        if (value := values[kind.name]) is not None
    ]
    if sigma.length_m:
        noise.append(f"commanded lengths {short(1e3 * sigma.length_m, 2)} mm")
    rows = f"{int(problem.use.sum())}"
    if not problem.use.all():
        rows += f" of {data.n_rows}"
    ways = int((~data.read).sum())
    if ways:
        rows += f", {counted(ways, 'way point')}"
    return [
        ("robot", f"{problem.robot.name}, {counted(problem.robot.n_cables, 'cable')}"),
        ("data", data.name),
        ("rows", rows),
        ("runs", str(len(data.runs))),
        ("readings", str(problem.n_readings)),
        ("assumed noise" if other_noise else "noise", ", ".join(noise)),
    ]
