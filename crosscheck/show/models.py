"""Models on the terminal: an effect that was added, a calibrated model, two models compared."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from crosscheck.add import Addition
from crosscheck.calibration import Calibrated
from crosscheck.comparison.models import ModelComparison
from crosscheck.model.fitted import Fitted
from crosscheck.show.blocks import Block, Items, Line, TextTable, cut, rms_table
from crosscheck.show.texts import printed
from seecr.counted import counted

_MOST = 12
# A value this many standard errors from null is sure.
_SURE = 3.0


@printed
def print_addition(found: Addition, model: Path, written: bool) -> Iterator[Block]:
    """Print values, errors before and after, warnings, and what was written."""
    yield Items(found.notes, "note: ", "dim")
    for one in found.fitted:
        term = one.term
        yield Line(f"{term.layout.name}: {term.layout.effect.title}", "bold")
        yield Items(cut(one.value_lines(), _MOST, "the model"), "  ")
    yield rms_table([
        ("before", found.before, ""),
        (f"with {found.name}", found.after, "bold"),
        (f"without {found.name}, on test runs", found.held_out_before, "dim"),
        (f"with {found.name}, on test runs", found.held_out, ""),
    ])  # fmt: skip
    yield Items(found.warnings, "warning: ", "bold yellow")
    yield Line(f"With {found.name}, {_left(found)}.", "green" if found.is_noise else "")
    if not found.pays:
        yield Line(why_not(found, written), "bold yellow")
    if written:
        yield Line(f"Written to {model}: {', '.join(one.term.name for one in found.fitted)}")


def why_not(found: Addition, forced: bool = False) -> str:
    """Why an effect is not worth adding, and that --force adds it, or has added it."""
    then = "added because of --force" if forced else "--force adds it anyway"
    return f"{found.why_not}: it is not worth adding; {then}"


def _left(found: Addition) -> str:
    if found.coloured is not None:
        may = "may be" if found.is_open else "are"
        return f"the residuals {may} noise ({found.coloured.words})"
    if found.is_noise:
        return "the residuals are noise"
    return (
        f"the residuals are {found.whiteness.scale:.3g} times the noise: find what else is "
        "missing with crosscheck diagnose"
    )


@printed
def print_calibration(found: Calibrated, model: Path, written: bool) -> Iterator[Block]:
    """Print the errors, how far each effect is from nothing, the noise, and what was written."""
    yield Items(found.notes, "note: ", "dim")
    yield rms_table([
        ("before", found.before, ""),
        ("calibrated", found.after, "bold"),
        ("calibrated, on test runs", found.held_out, ""),
    ])  # fmt: skip
    largest = [_largest(one) for one in found.fitted]
    rows = [
        [one.term.name, str(len(one.term.layout)), None if size is None else f"{size:.1f}"]
        for one, size in zip(found.fitted, largest, strict=True)
    ]
    yield TextTable(["effect", "#parameters", "#largest value in standard errors"], rows)
    if not any(size is not None and size > _SURE for size in largest):
        yield Line(
            f"No single effect differs from null by {_SURE:g} standard errors: others can replace "
            "each of them, and only together they predict; crosscheck diagnose finds which are "
            "missing"
        )
    yield Items(found.noise_lines())
    yield Items(found.absent_lines(), style="dim")
    if not found.settled:
        yield Line("The fit did not converge: do not use its values.", "bold yellow")
    elif not found.pays:
        then = "" if written else ": not written; --force writes it"
        yield Line(f"The prediction of test runs does not improve{then}", "bold yellow")
    if written:
        parts = (
            f"{counted(len(found.fitted), 'effect')}, {counted(len(found.covariance), 'parameter')}"
        )
        yield Line(f"Written to {model}: {parts}, with their covariance")


def _largest(one: Fitted) -> float | None:
    """The value that stands out most from null, in standard errors; None where none is seen."""
    away = np.abs(one.term.vector - one.term.layout.null)
    seen = (one.stderr > 0.0) & np.isfinite(one.stderr)
    return float(np.max(away[seen] / one.stderr[seen])) if seen.any() else None


@printed
def print_models(found: ModelComparison, pooled: Path | None) -> Iterator[Block]:
    """Print what moved, what neither settles, what one has alone, and where the pooled model is."""
    yield Line(f"{found.before} → {found.now}", "bold")
    yield Line(found.sentence, "bold yellow" if found.differs else "green" if found.values else "")
    yield Items(found.details, "  ")
    if pooled is not None and found.pooled is not None:
        yield Line(f"Written to {pooled}: {', '.join(found.pooled.names)}, both together")
    elif pooled is not None:
        why = "the values differ" if found.differs else "they have no value in common"
        yield Line(f"{pooled} was not written: {why}, so that no one model holds for both")
