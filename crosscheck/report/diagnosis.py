"""What stands on ``diagnosis.html``: verdict, figures and tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from crosscheck.diagnosis.result import Diagnosis
from crosscheck.diagnosis.words import noise_is_other, probability_name, within_words
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.fit.words import rms_words
from crosscheck.report.cables import draw_wall, walls_of
from crosscheck.report.confusion import confusion_of, draw_confusion
from crosscheck.report.drawing import AFTER, BEFORE, CALM, TINT
from crosscheck.report.findings import finding_card
from crosscheck.report.page import facts, title_of
from crosscheck.report.tables import association_block, candidate_rows, checks, untried
from crosscheck.report.waterfall import waterfall
from crosscheck.report.where import caption, failure_map


@dataclass(frozen=True)
class _Searched:
    """Facts and figures about a search; empty where there was none.

    Attributes:
        facts: about the data, and what is left of the errors.
        other_noise: whether noise was found to be other than that assumed.
        waterfall, map, confusion: figures; "" for none.
        walls: figures of residuals, one for each kind of reading.
        twins: effects that imitate each other.
        caption: of the map.
        together: whether the noise of the lengths couples the readings.
        added: names of the effects that the last model has beyond the given one.
        tint: colour of what the last model does not explain.
    """

    facts: Sequence[tuple[str, str]] = ()
    other_noise: bool = False
    waterfall: str = ""
    map: str = ""
    confusion: str = ""
    walls: Sequence[str] = ()
    twins: Sequence[tuple[str, str]] = ()
    caption: str = ""
    together: bool = False
    added: Sequence[str] = ()
    tint: str = BEFORE


def diagnosis_context(found: Diagnosis) -> dict[str, object]:
    """What the template of a diagnosis asks for."""
    of = f" of {title_of(found.path.problem)}" if found.path is not None else ""
    return {
        "page_title": f"{found.verdict.heading}{of}",
        "heading": f"Diagnosis{of}",
        "verdict": found.verdict.value,
        "verdict_name": found.verdict.heading,
        "verdict_meaning": found.verdict.meaning,
        "sentence": found.reason,
        "before": rms_words(found.before),
        "floor": rms_words(found.floor),
        "can_show": [] if found.sight is None else found.sight.lines(),
        "notes": list(found.notes),
        "measure_next": list(found.measure_further),
        "findings": [finding_card(found, finding) for finding in found.missing],
        "probability": probability_name(found),
        "within": within_words(found),
        "candidates": candidate_rows(found),
        "untried": untried(found),
        "after": AFTER,
        "checks": checks(found),
        "where": [association_block(row) for row in found.where],
        **vars(_searched(found)),
    }


def _searched(found: Diagnosis) -> _Searched:
    if found.path is None:
        return _Searched()
    problem = found.path.problem
    before, last = found.path.first, found.path.last
    confusion = confusion_of(found)
    other = noise_is_other(found)
    calm = found.verdict is DiagnosisVerdict.NO_EFFECT_MISSING
    alone = CALM if calm else BEFORE
    walls = [draw_wall(wall, alone) for wall in walls_of(problem, before, last)]
    added = [n for n in last.state.terms.names if n not in found.path.base]
    return _Searched(
        facts=[*facts(problem, other_noise=other), *_unknown_facts(found)],
        other_noise=other,
        waterfall=Markup(waterfall(found)),  # ours, escaped there; so are the others
        map=Markup(failure_map(problem, before, last)),
        confusion="" if confusion is None else Markup(draw_confusion(confusion)),
        walls=[Markup(text) for text in walls],
        twins=[] if confusion is None else confusion.twins,
        caption=caption(problem, before),
        together=bool(problem.sigma.length_m),
        added=added,
        tint=TINT if added else alone,
    )


def _unknown_facts(found: Diagnosis) -> list[tuple[str, str]]:
    """How large noise is if not as assumed, what is left, and what could not have been seen."""
    out = [("estimated noise", rms_words(found.floor))] if noise_is_other(found) else []
    if found.left is not None:
        out.append(("error beyond the noise", found.left.words))
    if found.chances is not None and found.chances.words:
        shown = found.chances.shown
        words = "at no size" if shown is None else f"from {rms_words(shown)} rms on"
        out.append(("smooth unknown effect visible", words))
    return out
