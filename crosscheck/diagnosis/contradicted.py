"""Says where a value that the model takes for known contradicts the data.

A wrong value that no fit may change is a missing effect in disguise: others are found in its place.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crosscheck.diagnosis.node import LEAST_GAIN
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.fit.effects.candidates import Trials
from crosscheck.fit.effects.gauss_newton import Fit
from crosscheck.fit.effects.possible import can_be
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.fit.words import value_lines
from seecr.effects import Term
from seecr.effects.knowledge import Knowledge
from seecr.errors import InputError

_SOMETHING = (
    DiagnosisVerdict.EFFECTS_FOUND,
    DiagnosisVerdict.MANY_EFFECTS,
    DiagnosisVerdict.UNKNOWN_EFFECT,
)


def contradicted_values(found: Diagnosis) -> dict[str, str]:
    """Notes, by effect of the model, where known values explain less than others would.

    Others explain more if fitting them, alone, has far more evidence than what was found has.
    """
    if found.search is None or found.verdict not in _SOMETHING:
        return {}
    trials, base = found.search.trials, found.search.steps[0].fit
    best = max(trials.evidence(one).log for one in (base, found.search.last.fit))
    out = {}
    for term in base.terms:
        freed = _freed(trials, base, term) if term.knowledge.any else None
        least = best + _of_readings(term) + LEAST_GAIN
        if freed is not None and trials.evidence(freed).log > least:
            out[term.name] = _note(found, term, freed)
    return out


def _of_readings(term: Term) -> float:
    """ln of the density that independent readings have by themselves, per plausible size.

    The evidence of a fit leaves such constants out; without the readings there are none.
    """
    own, known = term.knowledge.measured, term.knowledge
    return float(np.sum(np.log(term.layout.scale[own] / known.stderr[own])))


def _freed(trials: Trials, base: Fit, term: Term) -> Fit | None:
    """The model as it stands, with an effect fitted as if nothing were known of it."""
    free = replace(term, knowledge=Knowledge.nothing(len(term.layout)))
    try:
        out = trials.refit(base.terms.with_term(free), base.state)
    except (InputError, np.linalg.LinAlgError):  # a law of the user's own that refuses values
        return None
    plain = out.valid and can_be(trials.problem.robot, out.terms, base.terms)
    return out if plain and out.settled else None


def _note(found: Diagnosis, term: Term, freed: Fit) -> str:
    own, knowledge = freed.terms.part(term.name), term.knowledge
    error = np.where(knowledge.fixed | knowledge.measured, freed.stderr[own], 0.0)
    new, bound = freed.terms[term.name], freed.at_bound[own]
    lines = value_lines(term.layout, new.vector, error, bound)
    free = ", ".join(line for line, some in zip(lines, error > 0.0, strict=True) if some)
    missing = " + ".join(effect.effect for effect in found.missing) or "what was tried"
    return (
        f"what the model takes for known of {term.name} contradicts these data: fitted to them it "
        f"would be {free}, which explains far more than {missing}. Check it first"
    )
