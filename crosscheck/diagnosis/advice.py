"""What to do next: how to check an effect by hand, tell two apart, or find an unknown one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from crosscheck.comparison.associations import Association
from crosscheck.comparison.quantities import QuantityKind
from crosscheck.diagnosis.path import ModelPath
from crosscheck.diagnosis.result import MissingEffect
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.inference.fields import Varying
from crosscheck.planning.places import extensions
from crosscheck.planning.planned import Extension, Planned, Reads
from crosscheck.planning.proposer import Gain, Suggestion, telling_apart
from crosscheck.planning.result import signal_words
from seecr.description.robot import Robot
from seecr.effects import Term, effect_named
from seecr.pose import Array, rotvec_from_quat
from seecr.units import in_unit, parameter_name, with_error

# [m] No length is measured more finely by hand.
_LEAST_BY_HAND = 1e-5
# What was stated is rounded to this part of itself at most.
_STATED = 0.1
# Most ways that are named to tell two effects apart.
_MOST_WAYS = 2


class _Sure(float):
    """A number that is written to the first digit of its standard error.

    Nobody measures more digits by hand: 24114 with an error of 160 becomes 24100.
    """

    error: float

    def __new__(cls, value: float, error: float) -> _Sure:
        number = super().__new__(cls, value)
        number.error = error
        return number

    def __format__(self, form: str) -> str:
        if self == 0.0:
            return "0"
        if not np.isfinite(self.error):
            return format(float(self), form)
        value = float(self)
        if self.error > 0.0:
            value = round(value, -int(np.floor(np.log10(self.error)))) + 0.0
        shown, _ = with_error(value, self.error, digits=1)
        return f"+{shown}" if form.startswith("+") and self >= 0.0 else shown


class _Unknown(str):
    """What the data do not determine, instead of a number."""

    def __format__(self, form: str) -> str:
        return "?"


def check_of(term: Term, robot: Robot, stderr: Array | None = None) -> str:
    """An effect's independent check, with what to expect, to the digits that errors (k,) leave."""
    layout = term.layout
    if not term.is_possible(robot):
        return (
            f"{measured_directly(layout.name)}: no robot can have the values that fit these data "
            "best, so something else acts like this effect"
        )
    values: dict[str, _Sure | str] = {}
    errors = np.full(len(layout), np.inf) if stderr is None else stderr
    doubts = _errors_of_totals(term, robot, errors)
    # where nothing is determined the fit's own values are as good as any
    idle = _undetermined(term, errors) & bool(np.any(np.isfinite(errors)))
    lost = _errors_of_totals(term, robot, np.where(idle, np.inf, 0.0))

    def number(value: float, error: float, unit: str) -> _Sure:
        factor = in_unit(unit)[0]
        least = _LEAST_BY_HAND if unit == "m" else 0.0
        return _Sure(factor * float(value), factor * max(float(error), least))

    rows = zip(layout.names, layout.units, term.vector, errors, idle, strict=True)
    for name, unit, value, error, unknown in rows:
        shown = _Unknown() if unknown else number(value, error, unit)
        values[parameter_name(name, unit)] = shown
    # of several parameters that the data determine, the one that stands out most
    size = np.abs(term.vector - layout.null) / layout.scale * ~layout.shape
    known = np.isfinite(errors)
    size = np.where(known, size, 0.0) if np.any(size[known] > 0.0) else size
    k = int(np.argmax(size))
    values["which"] = parameter_name(layout.names[k], layout.units[k])
    values["largest"] = number(term.vector[k], errors[k], layout.units[k])
    for name, total in term.effect().totals(robot).items():
        key = "total" if name == layout.names[k] and len(layout) > 1 else name
        shown = number(total.value, doubts[name], total.unit)
        values[key] = _Unknown() if np.isinf(lost[name]) else shown
        # however little the fit says of it, what was stated is not rounded to nothing
        doubt = doubts[name]
        near = min(doubt, _STATED * abs(total.nominal)) if np.isfinite(doubt) else doubt
        values[f"{key}_nominal"] = number(total.nominal, near, total.unit)
    try:
        return layout.effect.advice.format(**values)
    except (KeyError, IndexError, ValueError):
        return layout.effect.advice


def _undetermined(term: Term, errors: Array) -> NDArray[np.bool_]:
    """(k,) which values the data do not determine; those on a bound are what they are."""
    bound = (term.vector == term.layout.lower) | (term.vector == term.layout.upper)
    return np.asarray(~np.isfinite(errors) & ~bound)


def _errors_of_totals(term: Term, robot: Robot, errors: Array) -> dict[str, float]:
    """Standard errors of measurable quantities, propagated from those of the parameters (k,)."""
    whole = {name: total.value for name, total in term.effect().totals(robot).items()}
    square = dict.fromkeys(whole, 0.0)
    for k, error in enumerate(errors):
        vector = term.vector.copy()
        vector[k] += error if np.isfinite(error) else term.layout.scale[k]
        for name, total in Term(term.layout, vector).effect().totals(robot).items():
            moved = total.value - whole[name]
            if moved != 0.0:
                square[name] += moved**2 if np.isfinite(error) else np.inf
    return {name: float(np.sqrt(value)) for name, value in square.items()}


_CALIBRATE = (
    "crosscheck calibrate writes a model with all effects, each as well as the data determine it; "
    "only checks by hand can say which effects are really there"
)
# Many small errors at once look like an unknown effect: no single one explains anything before the
# others are in the model.
_ALL_AT_ONCE = (
    "if every tolerance of the robot may be a little off: crosscheck calibrate fits all effects "
    "at once and reports the error on test runs"
)


def measure_next(
    path: ModelPath,
    missing: Sequence[MissingEffect],
    verdict: DiagnosisVerdict,
    where: Sequence[Association],
    seen: Sequence[Varying] = (),
) -> list[str]:
    """What to measure to tell effects apart, confirm or find them, a sentence each."""
    out, data = list[str](), path.problem.data
    plan = Planned(path.problem, path.last.state, path.search.data.factor, Reads.of(data))
    options = list(extensions(plan)) if any(effect.rivals for effect in missing) else []
    for effect in missing:
        out += _to_separate(plan, options, effect)
        if not effect.rivals:
            out.append(effect.confirmation)
    if verdict is DiagnosisVerdict.MANY_EFFECTS:
        out.append(_CALIBRATE)
    if verdict in (DiagnosisVerdict.MANY_EFFECTS, DiagnosisVerdict.UNKNOWN_EFFECT):
        out += [f"to find {what}: {what.advice}" for what in seen if what.advice]
    if verdict is DiagnosisVerdict.UNKNOWN_EFFECT:
        out += [_to_find(where), _ALL_AT_ONCE]
    if verdict is DiagnosisVerdict.NO_EFFECT_MISSING:
        out.append("nothing that matters is missing; to find smaller effects, use crosscheck plan")
    return list(dict.fromkeys(out))


def measured_directly(effect: str) -> str:
    """How to measure an effect without the robot's poses, in a few words."""
    return effect_named(effect).by_hand()


def _to_separate(plan: Planned, options: Sequence[Extension], effect: MissingEffect) -> list[str]:
    """What tells an effect from each of its rivals; what tells it from several is said once."""
    ways = {
        rival.name: telling_apart(plan, options, effect.effect, rival)[:_MOST_WAYS]
        for rival in effect.rivals
    }
    by_words: dict[str, dict[str, Gain]] = {}
    for name, some in ways.items():
        for way in some:
            by_words.setdefault(_words_of(way), {})[name] = way.gains[0]
    alone = {words: gains for words, gains in by_words.items() if len(gains) == 1}
    out = list[str]()
    for name, some in ways.items():
        own = [f"{w} {_signal(alone[w])}" for w in map(_words_of, some) if w in alone]
        out += _from_one(effect.effect, name, own, bool(some))
    for words, gains in by_words.items():
        if words not in alone:
            every = ", ".join(gains)
            out.append(f"to tell {effect.effect} from {every}: {words} {_signal(gains)}")
    return out


def _from_one(effect: str, rival: str, ways: Sequence[str], can_be: bool) -> list[str]:
    """What tells two effects apart: by hand, and by ways that tell no others apart, if any can."""
    start = f"to tell {effect} from {rival}:"
    direct = list(dict.fromkeys(measured_directly(n) for n in (effect, rival)))
    if not can_be:
        return [
            f"{start} {' or '.join(direct)}; none of the further poses, payloads and tensions "
            "tried here separates them"
        ]
    first = f"{start} {', or '.join([direct[-1], *ways[:1]])}"
    return [first, *(f"{start} {way}" for way in ways[1:])]


def _signal(gains: Mapping[str, Gain]) -> str:
    """How well a measurement tells an effect from others; from the closest, if from several."""
    least = min(gains.values(), key=lambda gain: gain.then)
    them = "them" if len(gains) == 1 else "the closest of them"
    return f"(signal that separates {them}: {signal_words(least)})"


def _words_of(way: Suggestion) -> str:
    if way.poses is None:
        return way.words
    places = ", ".join(_place(pose) for pose in way.poses)
    return f"add poses at {places}"


def _place(pose: Array) -> str:
    x, y, z = pose[:3]
    turn = np.degrees(rotvec_from_quat(pose[3:]))
    turned = f" turned by ({turn[0]:.3g} {turn[1]:.3g} {turn[2]:.3g}) deg"
    return f"({x:.3g} {y:.3g} {z:.3g}) m" + (turned if np.any(np.abs(turn) > 0.05) else "")


_PLACE = (
    "measure more poses along it, closer together, and some of them again at the end; an error "
    "that stays with the place comes from geometry or the tracker, one that does not comes from "
    "time or motion"
)
_RUN = "zero the winches and check the tracker before each run, and repeat the runs"
_TIME = "stay at one pose and read it for as long as the measurements took"
_FIRST = {
    QuantityKind.PLACE: _PLACE,
    QuantityKind.RUN: _RUN,
    QuantityKind.TIME: _TIME,
    QuantityKind.TEMPERATURE: _TIME,
}


def _to_find(where: Sequence[Association]) -> str:
    # an offset says nothing about where to look; what is left beside it does
    offset = next((one for one in where[:1] if one.kind is QuantityKind.EVERYWHERE), None)
    rest = next((one for one in where if one.kind is not QuantityKind.EVERYWHERE), None)
    again = "repeat the same poses forward, back and an hour later"
    if rest is None:
        found = f"{again}, to see what the error depends on"
    else:
        advice = _FIRST.get(rest.kind, f"{again}, and see whether that changes")
        error = "the unexplained error" if offset is None else "the rest"
        found = f"{error} depends on {rest.against}: {advice}"
    if offset is None:
        return found
    share = f"{100 * offset.share:.0f} %"
    return f"a constant offset is {share} of the mean square of the unexplained error; {found}"
