"""A diagnosis: what is missing, on the terminal, on its page, and in its recording."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from crosscheck.diagnosis.path import ModelPath, Stage
from crosscheck.diagnosis.result import Diagnosis, MissingEffect
from crosscheck.diagnosis.words import (
    equals_of,
    noise_is_other,
    probability_name,
    removed,
    within_words,
)
from crosscheck.fit.problem import Kind, Problem
from crosscheck.fit.reasons import DiagnosisVerdict, probability_words
from crosscheck.fit.residual_noise import STRUCTURED
from crosscheck.fit.words import rms_words
from crosscheck.inference.priors import SURE
from crosscheck.show.blocks import (
    Block,
    Bold,
    Check,
    Checks,
    Code,
    Dot,
    Figure,
    Items,
    Line,
    Page,
    Panel,
    TextTable,
    cut,
    present,
    rms_table,
    section,
)
from crosscheck.show.effect_figures import confusion_of, draw_confusion, robot_figure, waterfall
from crosscheck.show.error_figures import map_section, wall_section
from crosscheck.show.findings import (
    FILE,
    MOST_CANDIDATES,
    PLAUSIBLE,
    candidate_blocks,
    candidate_lines,
    card,
    in_brief,
)
from crosscheck.show.residuals import association_section, facts_of, title_of
from crosscheck.show.texts import kinds_table, markdown, printed, row_heading, unused
from seecr.show.colours import AFTER, BEFORE, CALM, TINT
from seecr.units import short

_STYLE = {
    DiagnosisVerdict.NO_EFFECT_MISSING: "green",
    DiagnosisVerdict.EFFECTS_FOUND: "bold cyan",
    DiagnosisVerdict.MANY_EFFECTS: "bold magenta",
    DiagnosisVerdict.UNKNOWN_EFFECT: "bold yellow",
    DiagnosisVerdict.NO_VERDICT: "bold red",
}
# Where not all fit, on the terminal and in a recording.
_MOST_PARAMETERS, _MOST_LISTED = 9, 6
# Noise within this factor of what was stated is as stated.
_AS_STATED = 1.25


# --- terminal -------------------------------------------------------------------------------------


@printed
def print_diagnosis(found: Diagnosis, out: Path) -> Iterator[Block]:
    """Print the verdict, the errors on the way, the parameters, and what to measure next."""
    yield Line(f"{found.verdict}: {found.reason}", _STYLE[found.verdict])
    yield Items(found.notes, "note: ", "dim")
    if found.verdict is not DiagnosisVerdict.NO_VERDICT:
        yield _way(found)
        if found.left is not None:
            yield Line(f"error beyond the noise: {found.left.words}", "dim")
        if found.chances is not None and found.chances.words:
            yield Line(f"note: {found.chances.words}", "dim")
        for finding in found.missing:
            likely = f"{probability_name(found)} {probability_words(finding.probability)}"
            yield Line(f"{finding.effect}: {finding.title} ({likely})", "bold")
            yield _finding(finding)
        if within := within_words(found):
            yield Line(f"note: {within}", "dim")
        yield from candidate_lines(found)
        yield Items(equals_of(found), style="dim")
    yield Items(found.sight.lines() if found.sight is not None else (), style="dim")
    yield Items(found.measure_further, "measure next: ")
    yield Line(f"Results in {out}/ (open diagnosis.html)", "dim")


def _way(found: Diagnosis) -> TextTable:
    rows = [("before", found.before, "")]
    for finding in found.missing:
        rows.append((f"+ {finding.effect}", finding.rms, ""))
        rows.append(("  on test runs", finding.held_out_rms, "dim"))
    return rms_table([*rows, ("noise alone", found.floor, "dim")])


def _finding(finding: MissingEffect) -> Items:
    """Its values, what it cannot be told from, and how to check it."""
    lines = cut(finding.value_lines(), _MOST_PARAMETERS, FILE)
    if finding.rivals:
        lines.append(f"indistinguishable from: {', '.join(finding.indistinguishable)}")
    return Items([*lines, f"check: {finding.check}"], "  ")


# --- page -----------------------------------------------------------------------------------------


def page_of_diagnosis(found: Diagnosis) -> Page:
    """The page of a diagnosis: the verdict, what to do, then figures and tables."""
    path, tests = found.path, checks(found)
    of = "" if path is None else f" of {title_of(path.problem)}"
    # beside a drawing with no effect in it there is room for what to do
    steps = found.measure_further
    blocks = present(
        None if path is None else _waterfall(found, path),
        _no_search(found),
        section("What to measure next", Items(steps) if steps and found.missing else None),
        None if path is None else section("The data", _facts(found, path.problem)),
        section("Missing effects, in the order in which they were added",
                *(card(found, k, one) for k, one in enumerate(found.missing, 1))),
        section("What speaks for it, and what against", Checks(tests) if tests else None),
        section("What these data can show",
                None if found.sight is None else Line(" ".join(found.sight.lines()), "dim")),
        *([] if path is None else _errors(found, path)),
        association_section("What the unexplained error depends on", found.where),
        section("What else was tried, and why it is not listed", *candidate_blocks(found)),
        _confusion(found),
    )  # fmt: skip
    cables = () if path is None else path.problem.robot.cable_names
    picture = None if path is None else robot_figure(path.problem.robot, found.missing)
    return Page(
        title=f"{found.verdict.heading}{of}",
        heading=f"Diagnosis{of}",
        verdict=found.verdict.value,
        name=found.verdict.heading,
        meaning=found.verdict.meaning,
        sentence=found.reason,
        lead=[in_brief(one, cables) for one in found.missing],
        then=() if found.missing else steps,
        picture=None if picture is None else Figure(picture, wide=False),
        blocks=blocks,
        notes=found.notes,
        footer="A named effect is the best explanation of those tried, not a proven cause: carry "
        "out its independent check. Errors are rms of single components, in the base frame. The "
        "same numbers, in SI: diagnosis.json.",
    )


def _facts(found: Diagnosis, problem: Problem) -> Block:
    """The data, how large noise is if not as assumed, what is left, what could not be seen."""
    other = noise_is_other(found)
    more = [("estimated noise", rms_words(found.floor))] if other else []
    if found.left is not None:
        more.append(("error beyond the noise", found.left.words))
    if found.chances is not None and found.chances.words:
        shown = found.chances.shown
        words = "at no size" if shown is None else f"from {rms_words(shown)} rms on"
        more.append(("smooth unknown effect visible", words))
    return facts_of(problem, *more, noise="assumed noise" if other else "noise")


def _no_search(found: Diagnosis) -> Line | None:
    if found.verdict is not DiagnosisVerdict.NO_VERDICT:
        return None
    floor = rms_words(found.floor)
    alone = f"; noise alone would give {floor}" if floor else ""
    before = rms_words(found.before) or "nothing to compare"
    return Line(f"Errors of the model: {before}{alone}. No effects were searched for.")


def _waterfall(found: Diagnosis, path: ModelPath) -> Panel | None:
    added = ", after each effect was added" if found.missing else ""
    estimated = "the estimated " if noise_is_other(found) else ""
    together = (
        " The noise of the commanded lengths moves several readings together, so an error within "
        "the noise of each reading need not be noise."
    ) * bool(path.problem.sigma.length_m)
    words = (
        "Bars (dots if the axis is logarithmic): rms error on test runs, which the model was "
        f"not fitted to{added}. Bracket: the range over these runs, with one tick for each. Faint "
        "mark: the same error on the rows that the model was fitted to, which proves nothing. Grey "
        f"background: the error that {estimated}noise alone would give.{together}"
    )
    title = "How the error falls" if found.missing else "How large the error is"
    return section(title, Figure(waterfall(found)), Line(words, "dim"))


def _errors(found: Diagnosis, path: ModelPath) -> list[Block | None]:
    """Where the errors are, and what those of each cable look like."""
    problem, before, last = path.problem, path.first, path.last
    calm = found.verdict is DiagnosisVerdict.NO_EFFECT_MISSING
    alone = CALM if calm else BEFORE
    added = [name for name in last.state.terms.names if name not in path.base]
    key: list[str] = [Dot(TINT if added else alone), "error of the given model"]
    if added:
        key += [" \N{NO-BREAK SPACE} ", Dot(AFTER), f"what remains with {' + '.join(added)}"]
    more = " Scale and colours are the same before and after." if found.missing else ""
    title = "Where the errors are" if calm else "Where the model fails"
    noise = "assumed noise" if noise_is_other(found) else "noise"
    return [
        map_section(title, problem, before, last, more),
        wall_section(
            "What the error looks like", problem, before, last, alone, [*key, ". "], noise
        ),
    ]


def _confusion(found: Diagnosis) -> Panel | None:
    if (confusion := confusion_of(found)) is None:
        return None
    words: list[str] = [
        "Percentage of the row's signal, over its expected sizes, that the column could imitate "
        "with these poses and readings."
    ]
    if confusion.twins:
        words.append(" Framed: ")
        for k, (a, b) in enumerate(confusion.twins):
            words += [", " * bool(k), Code(a), " and ", Code(b)]
        words.append(" imitate each other.")
    if found.missing:
        words.append(" Bold: the effects found.")
    figure = Figure(draw_confusion(confusion), wide=False)
    return section("Which effects these data can tell apart", figure, Line(words, "dim"))


# --- what was tested ------------------------------------------------------------------------------


def checks(found: Diagnosis) -> list[Check]:
    """What speaks for the verdict and what against it."""
    path, chances, w = found.path, found.chances, found.whiteness
    if path is None or chances is None or w is None:
        return []
    scales, _rhos = path.search.best.fit.noise.by_kind(path.problem)
    sizes = [f"{short(value)} times the assumed one ({kind})" for kind, value in scales.items()]
    out = [
        Check("size of the noise", max(scales.values()) < _AS_STATED, ", ".join(sizes)),
        Check(
            "neighbouring rows", not w.structured,
            f"their correlation is {short(max(w.lag_errors, w.neighbour_errors))} standard errors "
            f"from zero; white noise stays below {STRUCTURED:g}",
        ),
        Check("something unknown", chances.unknown < 1.0 - SURE,
              f"probability {probability_words(chances.unknown)}"),
        Check("effects tried", None, f"{path.tried}, in {len(path.search.cache)} models"),
    ]  # fmt: skip
    added = [stage for stage in path.stages if stage.added]
    if not added:
        return out
    better, blocks = _better_runs(path.stages)
    worst, largest = max(
        (float(np.max(np.abs(stage.fit.terms[stage.added].sizes))), stage.added) for stage in added
    )
    fit = path.last.fit
    labels = np.array(fit.terms.labels)[fit.at_bound].tolist()
    bound = list(dict.fromkeys(effect for effect, _name in labels))
    return [
        *out,
        Check("test runs", better == blocks, "each added effect improves the prediction of "
            f"{better} of {blocks}"),
        Check("sizes", worst < PLAUSIBLE and not bound, f"at most {short(worst, 2)} expected "
              f"sizes ({largest})" + (f"; at its bound: {', '.join(bound)}" if bound else "")),
    ]  # fmt: skip


def _better_runs(stages: Sequence[Stage]) -> tuple[int, int]:
    """Runs left out whose error falls with every effect that was added, and all.

    Only of steps with the same blocks: those of an effect with values for each run are others.
    """
    pairs = [(a.held_out.chi2, b.held_out.chi2) for a, b in itertools.pairwise(stages)]
    falls = [a - b for a, b in pairs if len(a) == len(b)]
    least = np.min(falls, axis=0) if falls else np.zeros(0)
    return int(np.sum(least > 0)), len(least)


# --- texts of a recording -------------------------------------------------------------------------


def diagnosis_text(found: Diagnosis, scene: Sequence[str]) -> str:
    """The verdict, what to measure next, what was assumed, and how to read the views.

    Args:
        found: the diagnosis. scene: what is drawn, in words; empty if nothing is.
    """
    steps = cut(found.measure_further, _MOST_LISTED, FILE)
    notes = cut(found.notes, _MOST_LISTED, FILE)
    play = (
        " goes from the model as it stood through the effects added. ", Code("pose"),
        " (choose it at the bottom left) goes through the measured poses: orange edges measured, "
        "blue the last model, pink edges the first.",
    )  # fmt: skip
    blocks = present(
        Line(found.reason),
        Line((Bold("Scene."), " ", *scene, " Blue box and cables: the model at the worst pose; "
              "orange edges: what was measured there.")) if scene else None,
        Line((Bold("Play."), " ", Code("model_step"), *play)) if scene else None,
        section("What to measure next", Items(steps)) if steps else None,
        section("Notes", Items(notes)) if notes else None,
    )  # fmt: skip
    return markdown(blocks, found.verdict.heading)


def step_text(
    found: Diagnosis, stages: Sequence[Stage], k: int, kinds: Sequence[Kind], line: int
) -> str:
    """The k-th model: its errors, and its last effect; ``line`` is that of the worst pose in the
    data.
    """
    stage, fitted = stages[k], stages[k].rms
    errors = [
        (stage.held_out.rms[kind.key], fitted[kind.key], found.floor.get(kind.key) or 0.0)
        for kind in kinds
    ]
    finding = next((f for f in found.missing if f.effect == stage.added), None)
    more: Iterable[Block] = ()
    if finding is not None:
        more = [Line(f"It {removed(finding.share)}: {finding.title}."), _finding(finding)]
    elif found.candidates and len(stages) == 1:
        rows = [(row.effect, str(row.why_not)) for row in found.candidates[:MOST_CANDIDATES]]
        more = [TextTable(["tried", "why not listed"], rows)]
    table = kinds_table(kinds, errors, ("test runs", "fitted runs", "noise"))
    box = Line(f"The box shows the worst pose, line {line} of the data.")
    title = f"Step {k} of {len(stages) - 1}: {stage.label}"
    return markdown([Panel(title, [table, *more, box])])


def pose_of_step_text(
    problem: Problem, stages: Sequence[Stage], kinds: Sequence[Kind], k: int
) -> str:
    """The numbers of one row under the first and the last model."""
    head = row_heading(problem.data, k)
    if not problem.use[k]:
        return head + markdown([unused(problem.data, k)])
    ends = stages if len(stages) < 2 else [stages[0], stages[-1]]
    sizes = [[float(kind.sizes(problem, s.state.raw)[k]) for s in ends] for kind in kinds]
    return head + markdown([kinds_table(kinds, sizes, [s.label for s in ends], "error")])
