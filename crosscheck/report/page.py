"""``diagnosis.html``: verdict, figures and tables put into one page that needs nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from crosscheck.diagnosis.result import Diagnosis
from crosscheck.diagnosis.steps import shown_stages, stages_of
from crosscheck.files import write_text
from crosscheck.fit.problem import Problem, kinds_read
from crosscheck.fit.words import rms_words
from crosscheck.made import Made
from crosscheck.report.cables import draw_wall, walls_of
from crosscheck.report.confusion import confusion_of, draw_confusion
from crosscheck.report.findings import finding_card
from crosscheck.report.tables import association_block, candidate_rows, checks
from crosscheck.report.waterfall import waterfall
from crosscheck.report.where import caption, failure_map
from crosscheck.units import short
from seecr import __version__

_NO_SEARCH: dict[str, Any] = {
    "title": "", "facts": [], "figures": dict.fromkeys(("waterfall", "map", "confusion"), ""),
    "walls": [], "twins": [], "caption": "", "added": [], "together": False, "unsure": False,
}  # fmt: skip


def write_report(found: Diagnosis, path: str | Path, made: Made | None = None) -> None:
    """Write a diagnosis as one self-contained page.

    Args:
        found: the diagnosis.
        path: the ``.html`` file; a temporary one takes its place when complete.
        made: how it came about, for the page's foot.

    Raises:
        InputFileError: the file cannot be written.
    """
    write_text(Path(path), render(found, made), failure="cannot write the report")


def render(found: Diagnosis, made: Made | None = None) -> str:
    """The page's text."""
    return page_of("report.html.jinja", made, **_context(found))


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
    said = "" if made is None else made.words
    return environment.get_template(template).render(version=__version__, made=said, **context)


def _context(found: Diagnosis) -> dict[str, Any]:
    return {
        "verdict": found.verdict.value,
        "verdict_name": found.verdict.heading,
        "verdict_meaning": found.verdict.meaning,
        "sentence": found.sentence,
        "before": rms_words(found.before),
        "floor": rms_words(found.floor),
        "can_show": [] if found.sight is None else found.sight.lines(),
        "notes": list(found.notes),
        "measure_next": list(found.measure_next),
        "findings": [finding_card(found, finding) for finding in found.missing],
        "candidates": candidate_rows(found),
        "checks": checks(found),
        "where": [association_block(row) for row in found.where],
        **_of_search(found),
    }


def _of_search(found: Diagnosis) -> dict[str, Any]:
    """Facts and figures; empty where there was no search."""
    if found.search is None:
        return _NO_SEARCH
    problem = found.search.problem
    before, after = shown_stages(found)
    # what the wall overlays is the last model, sure or not: it shows what was tried
    last = stages_of(found)[-1]
    confusion = confusion_of(found)
    figures = {
        "waterfall": waterfall(found),
        "map": failure_map(problem, before, after),
        "confusion": draw_confusion(confusion) if confusion is not None else "",
    }
    walls = [draw_wall(wall) for wall in walls_of(problem, before, last)]
    return {
        "title": f"{problem.robot.name} · {problem.data.path.name}",
        "facts": [*facts(problem), *unknown_facts(found)],
        "figures": {key: Markup(text) for key, text in figures.items()},  # ours, escaped there
        "walls": [Markup(text) for text in walls],
        "twins": confusion.twins if confusion is not None else [],
        "caption": caption(problem, before),
        "together": bool(problem.sigma.length_m),
        "unsure": not all(stage.listed for stage in stages_of(found)),
        "added": [n for n in last.state.terms.names if n not in found.search.base],
    }


def unknown_facts(found: Diagnosis) -> list[tuple[str, str]]:
    """How large what is left is, and what could not have been seen."""
    out = [] if found.left is None else [("left beyond noise", found.left.words)]
    if found.chances is not None:
        shown = found.chances.shown
        words = "at no size" if shown is None else f"from {rms_words(shown)} rms on"
        out.append(("a smooth unknown effect shows", words))
    return out


def facts(problem: Problem) -> list[tuple[str, str]]:
    """What was measured, in a few words."""
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
        rows += f", {ways} way point" + "s" * (ways > 1)
    return [
        ("robot", f"{problem.robot.name}, {problem.robot.n_cables} cables"),
        ("data", data.path.name),
        ("rows", rows),
        ("runs", str(len(data.runs))),
        ("readings", str(problem.n_readings)),
        ("noise", ", ".join(noise)),
    ]
