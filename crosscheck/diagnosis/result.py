"""What a diagnosis says: the verdict, the effects that are missing, and its JSON."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from crosscheck.diagnosis.rivals import Rival
from crosscheck.diagnosis.search import Search
from crosscheck.fit.noise import Whiteness
from crosscheck.fit.problem import Rms
from seecr.effects import Term
from seecr.effects.base import Layout
from seecr.pose import Array

VERDICTS = ("no_effect_missing", "effects_found", "unknown_effect", "no_verdict")


@dataclass(frozen=True, eq=False)
class Finding:
    """An effect that the data warrant.

    Attributes:
        effect: its name. title: in words.
        layout: its parameters. values, stderr: (p,) in their units; stderr inf where unseen.
        at_bound: (p,) bool.
        rivals: effects these data cannot tell from it.
        check: how to see it without the robot's poses, with what to expect.
        rms: errors with it and those before it added, by kind.
        held_out_rms: the same on runs left out.
        share: part of the unexplained chi2 (of runs left out) that it took away.
    """

    effect: str
    title: str
    layout: Layout
    values: Array
    stderr: Array
    at_bound: np.ndarray
    rivals: tuple[Rival, ...]
    check: str
    rms: Rms
    held_out_rms: Rms
    share: float

    @property
    def term(self) -> Term:
        """The effect with its values."""
        return Term(self.layout, self.values)


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The whole answer.

    Attributes:
        verdict: one of VERDICTS. sentence: the same for a person.
        missing: effects, in the order of adding.
        before, after, held_out: rms errors by kind (``position_rms_m``, ...).
        floor: rms errors that noise alone would give.
        candidates: per effect not listed: name, score (gain in log evidence), why not.
        measure_next: what to measure, in words.
        notes: what was assumed, left out or estimated.
        search: the way, with every model on it; None without a verdict.
        whiteness: of what is left.
        where: what the unexplained part goes with, the strongest first.
        unsolved: there is no verdict because rows could not be solved.
    """

    verdict: str
    sentence: str
    missing: tuple[Finding, ...]
    before: Rms
    after: Rms
    held_out: Rms
    floor: Rms
    candidates: tuple[dict[str, Any], ...]
    measure_next: tuple[str, ...]
    notes: tuple[str, ...] = ()
    search: Search | None = None
    whiteness: Whiteness | None = None
    where: tuple[dict[str, Any], ...] = field(default_factory=tuple)
    unsolved: bool = False

    def as_json(self) -> dict[str, Any]:
        """The contract's JSON: numbers in SI, null where there is none."""
        return {
            "verdict": self.verdict,
            "sentence": self.sentence,
            "missing": [_finding(f) for f in self.missing],
            "before": _plain(self.before),
            "after": _plain(self.after),
            "held_out": _plain(self.held_out),
            "noise_floor": _plain(self.floor),
            "candidates": [_plain(c) for c in self.candidates],
            "measure_next": list(self.measure_next),
            "residual": None if self.whiteness is None else _plain(vars(self.whiteness)),
            "where": [_plain(w) for w in self.where],
            "notes": list(self.notes),
        }


def _finding(found: Finding) -> dict[str, Any]:
    parameters = {
        name: {"value": number(value), "stderr": number(error), "at_bound": bool(bound)}
        for name, value, error, bound in zip(
            found.layout.names, found.values, found.stderr, found.at_bound, strict=True
        )
    }
    return {
        "effect": found.effect,
        "indistinguishable": [rival.name for rival in found.rivals],
        "parameters": parameters,
        "check": found.check,
        **_plain(found.rms),
        "held_out": _plain(found.held_out_rms),
        "share_of_error_removed": number(found.share),
    }


def number(value: float | None) -> float | None:
    """A number JSON can hold; None for what is not finite."""
    return None if value is None or not np.isfinite(value) else float(value)


def _plain(table: dict[str, Any]) -> dict[str, Any]:
    return {
        key: number(float(value)) if isinstance(value, float | np.floating) else value
        for key, value in table.items()
    }
