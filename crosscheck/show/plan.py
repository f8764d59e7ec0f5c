"""A plan: what poses would show, on the terminal and on its page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from crosscheck.planning.proposer import Suggestion
from crosscheck.planning.result import Plan, Visible, alike, gain_words
from crosscheck.planning.visibility import NAMED
from crosscheck.show.blocks import (
    Block,
    Bold,
    Cell,
    Code,
    Figure,
    Items,
    Line,
    Page,
    Panel,
    Small,
    TextTable,
    Words,
    present,
    section,
)
from crosscheck.show.effect_figures import Confusion, draw_confusion, draw_sizes
from crosscheck.show.residuals import facts_of, title_of
from crosscheck.show.texts import printed
from seecr.counted import some
from seecr.pose import rotvec_from_quat
from seecr.units import short

_MOST_GAINS, _MOST_SLACK, _MOST_IN_BRIEF = 3, 5, 3


@printed
def print_plan(plan: Plan, out: Path, files: Sequence[str] = ()) -> Iterator[Block]:
    """Print what will show, what cannot be told apart, what to add, and the files of commands."""
    yield Items(plan.notes, "note: ", "dim")
    if plan.effects:
        rows = [[found.name, *_sizes(found)] for found in plan.effects]
        yield TextTable(
            ["effect", *_HEADS], rows, ["" if v.visible else "dim" for v in plan.effects]
        )
    missing = plan.missing.items()
    yield Items([f"{name}: {_UNTESTABLE}{why.words}" for name, why in missing], style="dim")
    if plan.slack:
        lines = [f"line {line} ({cable})" for line, cable in plan.slack]
        yield Line(
            f"Close to the limit between slack and taut: {some(lines, _MOST_SLACK)}. At these "
            "poses small errors change which cables are taut, so this plan is less certain about "
            "them.",
            "bold yellow",
        )
    for words in plan.demanded:
        yield Line(words)
    yield Line(plan.sentence, "bold")
    for item in plan.suggestions:
        if item.reached:
            gains = some([gain_words(gain) for gain in item.reached], _MOST_GAINS, "; ")
            yield Line(f"add: {item.words}: {gains}")
            yield Items(item.places, "     ")
            if item.demand is not None:
                yield Items([item.demand.words], "     ", "dim")
    more = f", commands in {', '.join(files)}" if files else ""
    yield Line(f"Results in {out}/{more}", "dim")


def page_of_plan(plan: Plan) -> Page:
    """The page of a plan."""
    problem = plan.planned.problem
    reached = [item for item in plan.suggestions if item.reached]
    near = [
        f"line {line}: {cable} is close to the limit between slack and taut; the plan is less "
        "certain about such poses"
        for line, cable in plan.slack
    ]
    return Page(
        title=f"Plan: {title_of(problem)}",
        heading=f"Plan of {title_of(problem)}",
        verdict="plan",
        name="What these poses can reveal",
        sentence=plan.sentence,
        lead=plan_in_brief(plan),
        blocks=present(
            section("The poses", facts_of(problem), *(Line(words) for words in plan.demanded)),
            *(_visible(plan) if plan.effects else ()),
            section("What to add", *(_card(k, item) for k, item in enumerate(reached, 1))),
            _confusion(plan) if plan.effects else None,
        ),
        notes=[*near, *plan.notes],
        footer="From sensitivities about the model: four in five effects of the sizes above are "
        f"found, with one false alarm in twenty plans; from {NAMED:g} times the smallest visible "
        "size on, a diagnosis names nine in ten. The same numbers, in SI: plan.json.",
    )


def plan_in_brief(plan: Plan) -> list[Words]:
    """What will be seen, what cannot be told apart, and what to add, a line each."""
    title = {found.name: found.signal.layout.effect.title for found in plan.effects}
    shows, pairs = [], []
    for found in plan.effects:
        if found.visible and found.twins:
            others = " or ".join(title.get(name, name) for name in found.twins)
            pairs.append(f"{title[found.name]} from {others}")
        elif found.visible:
            shows.append(
                f"{title[found.name]} (from {found.words(found.factor).split(', ')[0]} on)"
            )
    added = [item.words for item in plan.suggestions if item.reached]
    heads = ("You will see ", shows), ("You cannot tell ", pairs), ("To tell more: ", added[:1])
    return [(Bold(head), f"{some(parts, _MOST_IN_BRIEF, '; ')}.") for head, parts in heads if parts]


_HEADS = ("smallest visible size", "smallest size to name it", "indistinguishable from")
_UNTESTABLE = "not testable with these data: "


def _sizes(found: Visible) -> list[Cell]:
    """From which size on an effect shows, and can be named; what it cannot be told from."""
    named = None if found.twins else found.words(found.identifiable)
    return [found.words(found.factor), named, alike(found)]


def _visible(plan: Plan) -> Iterator[Block | None]:
    """How small each effect can be, as a figure and as a table."""
    words = (
        "The smallest visible size of each effect. Left of the dotted line, an effect of expected "
        "size is visible. Between dot and diamond the effect is visible, but the effect that "
        "imitates it best would explain the data as well; without a diamond, another effect "
        "imitates it exactly at these poses."
    )
    yield section(
        "How small an effect can be", Figure(draw_sizes(plan.effects)), Line(words, "dim")
    )
    rows: list[list[Cell]] = [
        [Code(found.name), short(found.factor, 2), *_sizes(found)] for found in plan.effects
    ]
    rows += [
        [Code(name), "", Small(f"{_UNTESTABLE}{why.words}")] for name, why in plan.missing.items()
    ]
    yield section("Each effect", TextTable(["effect", "#in expected sizes", *_HEADS], rows))


def _card(number: int, item: Suggestion) -> Panel:
    """What to add, what it brings, and its poses."""
    heads = ["#x [m]", "#y [m]", "#z [m]", "#turned about x [deg]", "#y [deg]", "#z [deg]"]
    poses = [
        [*(f"{v:.4g}" for v in pose[:3]),
         *(f"{v:.3g}" for v in np.degrees(rotvec_from_quat(pose[3:])))]
        for pose in (() if item.poses is None else item.poses)
    ]  # fmt: skip
    blocks = present(
        Items([gain_words(gain) for gain in item.reached]),
        TextTable(heads, poses) if poses else None,
        None if item.demand is None else Line(item.demand.words, "dim"),
    )
    return Panel(f"{number}. {item.words}", blocks, "card")


def _confusion(plan: Plan) -> Panel | None:
    """Which effects that show could be mistaken for which."""
    names, part = plan.confusion
    visible = {one.name for one in plan.effects if one.visible}
    seen = [k for k, name in enumerate(names) if name in visible]
    if len(seen) < 2:
        return None
    confusion = Confusion(tuple(names[k] for k in seen), 0, part[np.ix_(seen, seen)])
    figure = Figure(draw_confusion(confusion), wide=False)
    words = (
        "Percentage of the row's signal, over its expected sizes, that the column could imitate. "
        "Framed: they imitate each other."
    )
    return section("Which effects could be mistaken for which", figure, Line(words, "dim"))
