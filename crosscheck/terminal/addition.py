"""The fit of an effect, on the terminal."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from crosscheck.add import Addition
from crosscheck.fit.evidence import FALSE_ALARM
from crosscheck.model.fitted import Fitted
from crosscheck.terminal.lines import console_for, print_parameters, rms_table, say
from crosscheck.units import with_error

_MOST = 12


def print_addition(
    found: Addition, model: Path, written: bool, console: Console | None = None
) -> None:
    """Print values, errors before and after, warnings, and what was written."""
    console = console_for(console, found.notes)
    for fitted in found.fitted:
        _print_values(console, fitted)
    console.print(_table(found))
    for warning in found.warnings:
        say(console, f"warning: {warning}", "bold yellow")
    say(console, f"With {found.name}, {_left(found)}.", "green" if found.is_noise else "")
    if not found.pays:
        say(console, why_not(found, written), "bold yellow")
    if written:
        say(console, f"Written to {model}: {', '.join(f.term.name for f in found.fitted)}")


def why_not(found: Addition, forced: bool = False) -> str:
    """Why an effect is not worth adding, and that --force adds it, or has added it."""
    mean, error = found.fall
    if found.is_nothing:
        reason = _nothing(found)
    elif found.p >= FALSE_ALARM:
        reason = f"what {found.name} explains is not significant (p = {found.p:.2g})"
    else:
        reason = (
            f"{found.name} does not improve the prediction of held-out runs (chi2 of a block "
            f"falls by {' ± '.join(with_error(mean, error))})"
        )
    then = "added because of --force" if forced else "--force adds it anyway"
    return f"{reason}: it is not worth adding; {then}"


def _nothing(found: Addition) -> str:
    """That the values are nothing: not seen, nothing itself, or within their errors of it."""
    own = [one for one in found.fitted if one.term.name in found.names]
    errors = np.concatenate([one.stderr[~one.term.layout.shape] for one in own])
    if not (np.isfinite(errors) & (errors > 0.0)).any():
        return f"{found.name} is not determined by these data: any value fits them equally well"
    if found.from_nothing == 0.0:
        return f"{found.name} comes out at its null values"
    together = ", all values together" if len(errors) > 1 else ""
    return (
        f"{found.name} differs from null by no more than its standard errors "
        f"({found.from_nothing:.2g} of them{together})"
    )


def _left(found: Addition) -> str:
    if found.is_noise:
        kind = "" if found.coloured is None else f" ({found.coloured.words})"
        return f"the residuals are noise{kind}"
    return (
        f"the residuals are {found.whiteness.scale:.3g} times the noise: find what else is "
        "missing with crosscheck diagnose"
    )


def _print_values(console: Console, fitted: Fitted) -> None:
    layout = fitted.term.layout
    say(console, f"{layout.name}: {layout.effect.title}", "bold")
    print_parameters(
        console, layout, fitted.term.vector, fitted.stderr, fitted.at_bound, _MOST, "the model"
    )


def _table(found: Addition) -> Table:
    rows = (
        ("before", found.before, ""),
        (f"with {found.name}", found.after, "bold"),
        ("before, on held-out runs", found.held_out_before, "dim"),
        (f"with {found.name}, on held-out runs", found.held_out, ""),
    )
    return rms_table(rows)
