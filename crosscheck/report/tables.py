"""The page's tables: findings with their parameters, what was tested, candidates with reasons."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.diagnosis.order import Step
from crosscheck.diagnosis.result import Diagnosis, DiagnosisVerdict, MissingEffect
from crosscheck.diagnosis.steps import stages_of
from crosscheck.diagnosis.verdict import percent
from crosscheck.fit.candidates import Candidate
from crosscheck.fit.evidence import FALSE_ALARM, p_value
from crosscheck.fit.noise import POOR_FIT, STRUCTURED
from crosscheck.fit.problem import KINDS, Rms
from crosscheck.units import chance, in_unit, parameter_name, short, with_error

# Correlations above this are named; parameters beyond this many plausible sizes are doubtful.
_CORRELATED, _PLAUSIBLE = 0.9, 5.0
_MOST_CORRELATIONS = 8


@dataclass(frozen=True)
class Check:
    """One thing that was tested: ``good`` is None where it says nothing by itself."""

    name: str
    good: bool | None
    words: str

    @property
    def mark(self) -> str:
        """A sign that reads without its colour."""
        return {True: "✓", False: "✗", None: "·"}[self.good]


def checks(found: Diagnosis) -> list[Check]:
    """What speaks for the verdict and what against it."""
    if found.search is None or found.whiteness is None:
        return []
    w = found.whiteness
    out = [
        Check(
            "size of what is left", w.p > POOR_FIT,
            f"χ² per reading {short(w.chi2 / w.dof)} (chance {chance(w.p)})",
        ),
        Check(
            "neighbouring rows", not w.structured,
            f"agree by {short(max(w.lag_errors, w.neighbour_errors))} standard errors, "
            f"noise by less than {STRUCTURED:g}",
        ),
    ]  # fmt: skip
    return out + _of_effects(found)


def _of_effects(found: Diagnosis) -> list[Check]:
    assert found.search is not None
    tried = _tried(found.search.steps[0])
    steps = [stage.step for stage in itertools.takewhile(lambda s: s.listed, stages_of(found))]
    if len(steps) == 1:
        smallest = min((c.p for c in steps[0].candidates if c.drop > 0), default=1.0)
        return [
            Check("effects tried", None, f"{tried}; chance explains each of them "
                  f"(smallest p over all {chance(min(1.0, tried * smallest))})")
            if found.verdict is DiagnosisVerdict.NO_EFFECT_MISSING
            else Check("effects tried", None, str(tried))
        ]  # fmt: skip
    better, blocks = _better_runs(steps)
    worst = max(_largest_sizes(step) for step in steps[1:])
    p = max(_chance(steps[k - 1], steps[k]) for k in range(1, len(steps)))
    bound = bool(np.any(steps[-1].fit.at_bound))
    return [
        Check("effects tried", None, str(tried)),
        Check("chance", p < FALSE_ALARM, f"explains what was added with p {chance(p)}, over all "
              "effects tried"),
        Check("runs left out", better == blocks, f"{better} of {blocks} predicted better with "
              "each effect added"),
        Check("sizes", worst < _PLAUSIBLE and not bound, f"at most {short(worst, 2)} plausible "
              "sizes" + (", and a parameter at its bound" if bound else "")),
    ]  # fmt: skip


def _tried(step: Step) -> int:
    return len([c for c in step.candidates if c.fit is not None or c.drop])


def _better_runs(steps: list[Step]) -> tuple[int, int]:
    """Runs left out whose error falls with every effect that was added, and all."""
    falls = [a.held_out.chi2 - b.held_out.chi2 for a, b in itertools.pairwise(steps)]
    least = np.min(falls, axis=0)
    return int(np.sum(least > 0)), len(least)


def _largest_sizes(step: Step) -> float:
    return float(np.max(np.abs(step.fit.terms[step.added].sizes)))


def _chance(before: Step, after: Step) -> float:
    """Chance of the fall of chi2, for as many effects as were tried."""
    count = len(after.fit.terms[after.added].layout)
    p = p_value(before.whiteness.chi2 - after.whiteness.chi2, count, False)
    return min(1.0, p * max(_tried(before), 1))


def finding_context(found: Diagnosis, finding: MissingEffect) -> dict[str, Any]:
    """A finding as the page shows it."""
    rows = [
        _parameter(*item)
        for item in zip(
            finding.layout.names, finding.layout.units, finding.values, finding.stderr,
            finding.at_bound, (finding.values - finding.layout.null) / finding.layout.scale,
            strict=True,
        )
    ]  # fmt: skip
    return {
        "effect": finding.effect,
        "title": finding.title,
        "place": finding.layout.effect.place,
        "share": percent(finding.share),
        "rivals": [{"name": r.name, "loss": short(max(r.loss, 0.0), 2)} for r in finding.rivals],
        "check": finding.check,
        "parameters": rows,
        "columns": 1 if len(rows) <= 8 else 2,
        "doubts": sum(1 for row in rows if row["flags"]),
        "correlations": _correlations(found, finding),
        "errors": errors_of(finding.held_out_rms),
    }


def _parameter(
    name: str, unit: str, value: float, error: float, bound: bool, size: float
) -> dict[str, Any]:
    factor, words = in_unit(unit)
    shown, spread = with_error(factor * float(value), factor * float(error))
    flags = []
    if bound:
        flags.append("at its bound")
    if not np.isfinite(error):
        flags.append("not seen by these data")
    if abs(size) > _PLAUSIBLE:
        flags.append(f"{short(float(abs(size)), 2)} plausible sizes")
    return {
        "name": parameter_name(name, unit), "value": shown, "stderr": spread, "unit": words,
        "flags": ", ".join(flags), "seen": bool(np.isfinite(error)),
    }  # fmt: skip


def _correlations(found: Diagnosis, finding: MissingEffect) -> list[str]:
    """Parameters that the data hold together, the strongest first."""
    assert found.search is not None
    best = found.search.last.fit
    every = best.terms.labels
    own = np.flatnonzero(best.terms.own(finding.effect))
    correlation = best.correlation
    pairs = {
        (min(i, j), max(i, j)): float(correlation[i, j])
        for i in own.tolist()
        for j in range(len(every))
        if i != j and abs(correlation[i, j]) > _CORRELATED
    }
    ranked = sorted(pairs.items(), key=lambda item: -abs(item[1]))
    out = []
    for (i, j), value in ranked[:_MOST_CORRELATIONS]:
        names = [
            every[k][1] if every[k][0] == finding.effect else ".".join(every[k]) for k in (i, j)
        ]
        out.append(f"{names[0]} with {names[1]} ({short(value)})")
    if len(ranked) > _MOST_CORRELATIONS:
        out.append(f"and {len(ranked) - _MOST_CORRELATIONS} more pairs")
    return out


def errors_of(rms: Rms) -> str:
    """The rms errors in a few words."""
    parts = [
        f"{short(value * kind.factor)} {kind.unit}"
        for kind in KINDS
        if (value := rms.get(kind.key)) is not None
    ]
    return ", ".join(parts)


def candidate_rows(found: Diagnosis) -> list[dict[str, Any]]:
    """Effects that were tried and are not listed, with the reason, the nearest miss first."""
    by_name = {}
    if found.search is not None:
        by_name = {c.name: c for c in found.search.steps[0].candidates}
    out = []
    for row in found.candidates:
        candidate = by_name.get(row.effect)
        out.append(
            {
                "effect": row.effect,
                "title": row.title,
                "score": short(row.score) if row.score else "",
                "alone": _alone(found, candidate),
                "needs": "" if candidate is None else _largest_parameter(candidate),
                "why_not": str(row.why_not),
            }
        )
    return out


def _alone(found: Diagnosis, candidate: Candidate | None) -> float | None:
    """Part of the excess chi2 that the effect takes away by itself, in sample, 0 to 1."""
    if candidate is None or candidate.fit is None or found.search is None:
        return None
    start = found.search.steps[0].fit
    noise = len(start.state.white) * found.search.noise_scale**2
    excess = start.chi2 - noise
    if excess <= 0.0:
        return None
    return float(np.clip((start.chi2 - candidate.fit.chi2) / excess, 0.0, 1.0))


def _largest_parameter(candidate: Candidate) -> str:
    """What it would take: the parameter that is largest in plausible sizes."""
    if candidate.fit is None:
        return ""
    term = candidate.fit.terms[candidate.name]
    layout = term.layout
    size = np.where(layout.shape, 0.0, term.sizes)
    k = int(np.argmax(np.abs(size)))
    factor, unit = in_unit(layout.units[k])
    name = parameter_name(layout.names[k], layout.units[k])
    doubt = f" ({short(abs(float(size[k])), 2)} plausible sizes)" if abs(size[k]) > 3 else ""
    # a factor near one is told from one by its later digits
    digits = 5 if layout.null[k] else 3
    return f"{name} = {short(factor * float(term.vector[k]), digits)} {unit}".strip() + doubt
