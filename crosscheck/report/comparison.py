"""What stands on ``comparison.html``: where a model is off."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from crosscheck.comparison.result import Comparison, Group
from crosscheck.diagnosis.path import Standing
from crosscheck.fit.least_squares.problem import KINDS, Rms
from crosscheck.report.cables import draw_wall, walls_of
from crosscheck.report.drawing import BEFORE, CALM
from crosscheck.report.page import facts, title_of
from crosscheck.report.tables import association_block
from crosscheck.report.where import caption, failure_map
from seecr.units import in_unit, short

_MOST = 5


def comparison_context(found: Comparison) -> dict[str, object]:
    """What the template of a comparison asks for."""
    problem, names = found.problem, list(found.terms.names)
    kinds = [kind for kind in KINDS if found.rms.get(kind.key) is not None]
    model = " + ".join(["SEECR", *names]) if names else "plain SEECR"
    verdict, words = _verdict(found)
    context: dict[str, object] = {
        "page_title": f"Comparison: {title_of(problem)}",
        "heading": f"Comparison of {title_of(problem)} with {model}",
        "verdict": verdict,
        "verdict_name": words,
        "verdict_meaning": "",
        "sentence": found.sentence,
        "facts": facts(problem),
        "heads": [f"#{kind.name} [{kind.unit}]" for kind in kinds],
        "groups": _groups(found),
        "coordinates": _coordinates(found),
        "tracking_title": found.tracking.title if found.tracking else "",
        "tracking": _tracking(found),
        "where": [association_block(a) for a in found.associations if a.significant][:_MOST],
        "worst": _worst(found),
        "notes": [
            *(f"line {row.line}, run {row.run}: {row.why}" for row in found.unsolved),
            *found.notes,
        ],
        "map": "",
        "walls": [],
        "caption": "",
    }
    if found.coordinates:
        stage = Standing(" + ".join(names) or "plain SEECR", found.state)
        context["map"] = Markup(failure_map(problem, stage, stage))  # ours, escaped there
        context["walls"] = [
            Markup(draw_wall(wall, CALM if found.is_noise else BEFORE))
            for wall in walls_of(problem, stage, stage)
        ]
        context["caption"] = caption(problem, stage)
    return context


def _verdict(found: Comparison) -> tuple[str, str]:
    """Its colour, by the diagnosis' verdict that has the same one, and its words."""
    if found.refusal is not None or found.whiteness is None:
        return "no_verdict", "No verdict"
    if found.is_noise:
        return "no_effect_missing", "Model and data agree"
    if found.is_open:
        return "no_verdict", "Noise, or something that the model misses"
    return "unknown_effect", "The model is off"


def _cells(found: Comparison, rms: Rms) -> list[str]:
    """The rms errors of those kinds that were read, in the units that people read."""
    kinds = [kind for kind in KINDS if found.rms.get(kind.key) is not None]
    values = [(kind.factor, rms.get(kind.key)) for kind in kinds]
    return ["–" if value is None else short(factor * value) for factor, value in values]


def _groups(found: Comparison) -> list[tuple[str, str, list[str]]]:
    """Name, rows and errors: of all rows, of noise, and of every run, travel and region."""
    out = [("all rows", str(int(found.problem.use.sum())), _cells(found, found.rms))]
    if found.outliers.any():
        rows = int((found.problem.use & ~found.outliers).sum())
        out.append(("without outliers", str(rows), _cells(found, found.rms_without)))
    out.append(("noise alone", "", _cells(found, found.floor)))
    every: Sequence[tuple[str, Sequence[Group]]] = (
        ("run", found.runs), ("travel", found.directions), ("region", found.regions),
    )  # fmt: skip
    for title, groups in every:
        if len(groups) > 1:
            out += [(f"{title} {g.name}", str(g.rows), _cells(found, g.rms)) for g in groups]
    return out


_Row = tuple[str, list[str], str, str]
"""Name, numbers, their unit, line of the largest."""


def _row(found: Comparison, name: str, values: Sequence[float], si: str, row: int) -> _Row:
    factor, unit = in_unit(si)
    return name, [short(factor * value) for value in values], unit, found.problem.data.place(row)


def _coordinates(found: Comparison) -> list[_Row]:
    """Of each reading: bias, rms and largest error."""
    return [
        _row(found, one.name, (one.bias, one.rms, one.max), one.unit, one.row)
        for one in found.coordinates
    ]


def _tracking(found: Comparison) -> list[_Row]:
    """Of each kind: rms and largest distance from the wanted poses."""
    away = found.tracking.away if found.tracking else ()
    return [_row(found, one.kind, (one.rms, one.max), one.unit, one.row) for one in away]


def _worst(found: Comparison) -> list[tuple[int, str, str, list[str], str]]:
    """Line, run, place, errors by kind, and how many times the noise."""
    kinds = [kind for kind in KINDS if found.rms.get(kind.key) is not None]
    return [
        (
            row.line,
            row.run,
            found.place(row.row),
            [short(kind.factor * float(found.errors_of(kind.name)[row.row])) for kind in kinds],
            short(row.times_noise),
        )
        for row in found.worst
    ]
