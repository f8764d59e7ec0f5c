"""What stands on ``plan.html``: what poses would show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from crosscheck.planning.proposer import Suggestion
from crosscheck.planning.result import Plan, Visible, alike, gain_words
from crosscheck.planning.visibility import NAMED
from crosscheck.report.confusion import Confusion, draw_confusion
from crosscheck.report.drawing import AFTER, BEFORE, INK, blank, grid, image, plain_log, styled
from crosscheck.report.page import facts, title_of
from seecr.pose import Array, rotvec_from_quat
from seecr.units import short

_ROW = 0.19


def plan_context(plan: Plan) -> dict[str, object]:
    """What the template of a plan asks for."""
    problem = plan.planned.problem
    context: dict[str, object] = {
        "page_title": f"Plan: {title_of(problem)}",
        "heading": f"Plan of {title_of(problem)}",
        "verdict": "plan",
        "verdict_name": "What these poses can reveal",
        "verdict_meaning": "",
        "sentence": plan.sentence,
        "facts": facts(problem),
        "effects": [_Row.of(found) for found in plan.effects],
        "missing": {name: why.words for name, why in plan.missing.items()},
        "suggestions": [_Added.of(item) for item in plan.suggestions if item.reached],
        "notes": [
            *(
                f"line {line}: {cable} is close to the limit between slack and taut; the plan is "
                "less certain about such poses"
                for line, cable in plan.slack
            ),
            *plan.notes,
        ],
        "sizes": "",
        "confusion": "",
        "named": f"{NAMED:g}",
    }
    if plan.effects:
        context["sizes"] = Markup(draw_sizes(plan.effects))  # ours, escaped there
        names, part = plan.confusion
        seen = np.array([any(v.name == name and v.visible for v in plan.effects) for name in names])
        if seen.sum() > 1:
            kept = tuple(name for name, some in zip(names, seen, strict=True) if some)
            matrix = Confusion(kept, 0, part[np.ix_(seen, seen)])
            context["confusion"] = Markup(draw_confusion(matrix))
    return context


def draw_sizes(effects: tuple[Visible, ...]) -> str:
    """The smallest size that shows and that can be named, in plausible sizes, of each effect."""
    shown = [found for found in effects if np.isfinite(found.factor)]
    with styled():
        figure = blank(_ROW * len(shown) + 0.9)
        axes = figure.subplots()
        place = np.arange(len(shown))[::-1]
        factor = np.array([found.factor for found in shown])
        named = np.array([np.nan if found.twins else found.identifiable for found in shown])
        axes.hlines(place, factor, np.where(np.isfinite(named), named, factor), color=INK, lw=0.6)
        axes.plot(factor, place, "o", color=AFTER, markersize=5, label="shows")
        axes.plot(named, place, "D", color=BEFORE, markersize=4, label="can be named")
        axes.axvline(1.0, color=INK, linewidth=0.8, linestyle=":")
        axes.set_yticks(place, [found.name for found in shown])
        axes.set_ylim(-0.7, len(shown) - 0.3)
        plain_log(axes)
        axes.set_xlabel("smallest visible size, in plausible sizes (dotted: 1)")
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
        grid(axes, "x")
        return image(figure, "The smallest visible sizes")


@dataclass(frozen=True)
class _Row:
    """An effect as people read it: from which size on it shows, and can be named."""

    name: str
    factor: str
    shows: str
    named: str
    alike: str

    @classmethod
    def of(cls, found: Visible) -> _Row:
        named = "–" if found.twins else found.words(found.identifiable)
        shows = found.words(found.factor)
        return cls(found.name, short(found.factor, 2), shows, named, alike(found))


@dataclass(frozen=True)
class _Added:
    """What to add, what it brings, and its poses as people read them."""

    words: str
    gains: list[str]
    poses: list[list[str]]

    @classmethod
    def of(cls, item: Suggestion) -> _Added:
        poses = [] if item.poses is None else [_cells(pose) for pose in item.poses]
        return cls(item.words, [gain_words(gain) for gain in item.reached], poses)


def _cells(pose: Array) -> list[str]:
    turn = np.degrees(rotvec_from_quat(pose[3:]))
    return [*(f"{v:.4g}" for v in pose[:3]), *(f"{v:.3g}" for v in turn)]
