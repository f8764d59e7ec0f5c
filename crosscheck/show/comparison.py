"""A comparison: where a model is off, on the terminal, on its page, and in its recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from crosscheck.comparison.limits import Exceeded
from crosscheck.comparison.quantities import QuantityKind, channels
from crosscheck.comparison.result import Comparison, WorstRow
from crosscheck.comparison.result import Group as Rows
from crosscheck.fit.problem import Kind
from crosscheck.show.blocks import (
    Block,
    Bold,
    Cell,
    Items,
    Line,
    Page,
    TextTable,
    Whole,
    heads_of,
    in_units,
    kinds_with,
    present,
    rms_cells,
    section,
    size_cells,
)
from crosscheck.show.error_figures import map_section, wall_section
from crosscheck.show.residuals import (
    Standing,
    association_section,
    facts_of,
    title_of,
)
from crosscheck.show.texts import kinds_table, markdown, printed, row_heading, unused
from seecr.counted import counted
from seecr.show.colours import BEFORE, CALM
from seecr.units import in_unit, short

# Groups, worst rows and rows without an equilibrium on the terminal; associations there and on the
# page; worst poses and notes in a recording.
_MOST_GROUPS, _MOST_WORST, _MOST_UNSOLVED = 12, 5, 5
_MOST_ASSOCIATIONS, _MOST_ON_PAGE = 4, 5
_MOST_POSES, _MOST_NOTES = 6, 5


@printed
def print_comparison(
    found: Comparison, exceeded: Sequence[Exceeded], limited: bool, out: Path
) -> Iterator[Block]:
    """Print the verdict, what exceeds its limit, the tables, and where the files are."""
    yield Line(found.sentence, "green" if found.is_noise else "bold yellow")
    yield Items([item.words for item in exceeded], style="bold red")
    if limited and not exceeded:
        yield Line("All limits hold.", "green")
    yield Items(found.notes, "note: ", "dim")
    if found.coordinates:
        yield _coordinates(found)
        yield _errors(found, _MOST_GROUPS)
        yield Items(_association_lines(found))
        yield Items([_worst_words(found, row) for row in found.worst[:_MOST_WORST]], "worst: ")
    if found.tracking is not None:
        yield Line(found.tracking.words(found.problem.data))
    yield Items(_unsolved(found)[:_MOST_UNSOLVED], style="bold yellow")
    if (more := len(found.unsolved) - _MOST_UNSOLVED) > 0:
        yield Line(f"{counted(more, 'more row')} without an equilibrium")
    yield Line(f"Results in {out}/", "dim")


def page_of_comparison(found: Comparison) -> Page:
    """The page of a comparison."""
    problem, names = found.problem, list(found.terms.names)
    model = " + ".join(["SEECR", *names]) if names else "plain SEECR"
    verdict, headline = _verdict(found)
    shown: list[Block | None] = []
    if found.coordinates:
        stage = Standing(" + ".join(names) or "plain SEECR", found.state)
        colour = CALM if found.is_noise else BEFORE
        significant = [one for one in found.associations if one.significant][:_MOST_ON_PAGE]
        shown = [
            map_section("Where the errors are", problem, stage, stage),
            section("How large the errors are", _errors(found)),
            section("The errors by coordinate", _coordinates(found)),
            _tracking(found),
            association_section("What the errors depend on", significant),
            wall_section("What the errors look like", problem, stage, stage, colour),
            section("The worst rows", _worst(found)) if found.worst else None,
        ]
    else:
        shown = [_tracking(found)]
    return Page(
        title=f"Comparison: {title_of(problem)}",
        heading=f"Comparison of {title_of(problem)} with {model}",
        verdict=verdict,
        name=headline,
        sentence=found.sentence,
        blocks=present(facts_of(problem), *shown),
        notes=[*_unsolved(found), *found.notes],
        footer="Nothing was fitted except what the notes name. Errors are rms of single "
        "components, in the base frame; those of the worst rows and distances from poses are whole "
        "vectors. The same numbers, in SI: comparison.json.",
    )


def verdict_text(found: Comparison, kinds: Sequence[Kind], scene: Sequence[str]) -> str:
    """The text of the recording: the verdict, and how to read the views, of which ``scene`` says
    what is drawn, if anything is.
    """
    blocks: list[Block | None] = [Line(found.sentence)]
    if found.terms:
        blocks.append(Line(f"Model: SEECR + {', '.join(found.terms.names)}."))
    if scene:
        rms = [(found.rms.get(kind.key), found.floor.get(kind.key)) for kind in kinds]
        worst = [
            [str(row.row), str(row.line), row.run, short(row.times_noise)]
            for row in found.worst[:_MOST_POSES]
        ]
        blocks += [
            kinds_table(kinds, rms, ("model", "noise")),
            Line((Bold("Scene."), " ", *scene,
                  " Blue box and cables: the model; orange edges: what was measured.")),
            section("Worst poses", TextTable(["pose", "line", "run", "times the noise"], worst)),
        ]  # fmt: skip
    if found.notes:
        blocks.append(section("Notes", Items(found.notes[:_MOST_NOTES])))
    return markdown(present(*blocks), _verdict(found)[1])


def pose_errors_text(found: Comparison, k: int) -> str:
    """The text of the recording for one row."""
    head = row_heading(found.problem.data, k)
    missing = [row.why for row in found.unsolved if row.row == k]
    if missing:
        return head + markdown([Line(f"No equilibrium to compare with: {missing[0]}.")])
    if not found.problem.use[k]:
        return head + markdown([unused(found.problem.data, k)])
    names, units = channels(found.problem)
    rows: list[list[Cell]] = [
        [name, short(in_unit(unit)[0] * float(found.state.raw[k, c])), in_unit(unit)[1]]
        for c, (name, unit) in enumerate(zip(names, units, strict=True))
        if found.problem.counted[k, c]
    ]
    rows.append(["moving", str(found.way.direction[k]), ""])
    return head + markdown([TextTable(["measured minus predicted", "", ""], rows)])


# --- verdict --------------------------------------------------------------------------------------


def _verdict(found: Comparison) -> tuple[str, str]:
    """Its colour, by the diagnosis' verdict that has the same one, and its words."""
    if found.refusal is not None or found.whiteness is None:
        return "no_verdict", "No verdict"
    if found.is_noise:
        return "no_effect_missing", "Model and data agree"
    if found.is_open:
        return "no_verdict", "Noise, or something that the model misses"
    return "unknown_effect", "The model is off"


def _unsolved(found: Comparison) -> list[str]:
    return [f"line {row.line}, run {row.run}: {row.why}" for row in found.unsolved]


# --- tables ---------------------------------------------------------------------------------------


def _coordinates(found: Comparison) -> TextTable:
    """Of each reading: bias, rms and largest error."""
    data = found.problem.data
    return TextTable(
        ["measured minus predicted", "#bias", "#rms", "#max", "#unit", "#at line", "#rows"],
        [
            [row.name, *in_units((row.bias, row.rms, row.max), row.unit), data.place(row.row),
             str(row.rows)]
            for row in found.coordinates
        ],
    )  # fmt: skip


def _tracking(found: Comparison) -> Block | None:
    """Of each kind: rms and largest distance from the wanted poses."""
    if found.tracking is None:
        return None
    table = TextTable(
        ["distance", "#rms", "#max", "#unit", "#at line"],
        [
            [one.kind, *in_units((one.rms, one.max), one.unit), found.problem.data.place(one.row)]
            for one in found.tracking.away
        ],
    )
    return section(f"How far the platform is {found.tracking.title}", table)


def _errors(found: Comparison, most: int | None = None) -> TextTable:
    """rms errors of all rows, of noise, and of each run, direction and region.

    Args:
        found: the comparison. most: groups of one kind that are listed; all by default.
    """
    kinds, problem = kinds_with([found.rms]), found.problem
    rows: list[Sequence[Cell]] = [
        ["all rows", *rms_cells(kinds, found.rms), str(int(problem.use.sum()))]
    ]
    styles = ["bold"]
    if found.outliers.any():
        kept = int((problem.use & ~found.outliers).sum())
        rows.append(["without outliers", *rms_cells(kinds, found.rms_without), str(kept)])
        styles.append("")
    rows.append(["noise alone", *rms_cells(kinds, found.floor), ""])
    styles.append("dim")
    every = (("run", found.runs), ("travel", found.directions), ("region", found.regions))
    for title, groups in every:
        if len(groups) > 1:
            rows += [
                [f"{title} {one.name}", *rms_cells(kinds, one.rms), str(one.rows)]
                for one in _largest(groups, most)
            ]
            if most is not None and len(groups) > most:
                rows.append([f"{len(groups) - most} more with smaller errors"])
            styles += [""] * (len(rows) - len(styles))
    return TextTable(["rms error", *heads_of(kinds), "#rows"], rows, styles)


def _largest(groups: Sequence[Rows], most: int | None) -> Sequence[Rows]:
    """Those with the largest errors of the first kind that was read, where they are too many."""
    if most is None or len(groups) <= most:
        return groups
    return sorted(groups, key=lambda g: -next((v for v in g.rms.values() if v), 0.0))[:most]


def _worst(found: Comparison) -> TextTable:
    kinds = kinds_with([found.rms])
    return TextTable(
        ["#line", "run", "place", *heads_of(kinds), "#times the noise"],
        [
            [
                str(row.line), row.run, Whole(found.place(row.row)),
                *size_cells(kinds, (found.errors_of(kind.name)[row.row] for kind in kinds)),
                short(row.times_noise),
            ]
            for row in found.worst
        ],
    )  # fmt: skip


# --- sentences ------------------------------------------------------------------------------------


def _worst_words(found: Comparison, row: WorstRow) -> str:
    kinds = kinds_with([found.rms])
    cells = size_cells(kinds, (found.errors_of(kind.name)[row.row] for kind in kinds))
    sizes = [
        f"{cell} {kind.unit}" for kind, cell in zip(kinds, cells, strict=True) if cell is not None
    ]
    return (
        f"line {row.line}, run {row.run}, {found.place(row.row)}: {', '.join(sizes)} "
        f"({row.times_noise:.3g} times the noise)"
    )


def _association_lines(found: Comparison) -> list[str]:
    strong = [a for a in found.associations if a.significant]
    if not strong:
        return ["The errors depend on nothing that was tested: position, time, tension, travel ..."]
    out = []
    for row in strong[:_MOST_ASSOCIATIONS]:
        factor, unit = in_unit(row.unit)
        steps = [(b.label, factor * b.mean) for b in row.bins if b.mean is not None]
        means = ", ".join(f"{mean:.3g} at {label}" for label, mean in steps[:6])
        share = f"{100 * row.share:.0f} %"
        text = f"Errors by {row.against}, which explains {share} of their variance"
        if row.kind is QuantityKind.EVERYWHERE:
            text = f"The errors have a constant offset ({share} of their mean square)"
            means = f"{steps[0][1]:.3g}"
        out.append(f"{text}: {row.strongest} [{unit}] {means}")
    return out
