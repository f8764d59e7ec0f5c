"""A field in the place of effects: its odds by covariances, and a picture that widens."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, term
from scipy import special, stats

from crosscheck.calibration.joint_fit.joint import JointFit, Setting, settle
from crosscheck.calibration.judgement.probability import Classes
from crosscheck.calibration.judgement.verdict import Judgement
from crosscheck.calibration.linear_evidence.gram import ColumnGroup, gram_of
from crosscheck.calibration.linear_evidence.priors import widths_of
from crosscheck.calibration.noise.colour import WHITE, chain_of
from crosscheck.calibration.search import _outdone, _still_there, search_sets
from crosscheck.calibration.sets.linear_search import Scores, log_prior
from crosscheck.calibration.unknown.field import FIELD_WIDTHS, UNKNOWN, field_of
from crosscheck.calibration.unknown.imitated import (
    NOT_ASKED,
    Imitated,
    _Sets,
    _with_fields,
    field_in_place,
)
from crosscheck.calibration.unknown.varying import Varying, anywhere, varying
from crosscheck.diagnosis.verdict import diagnose
from crosscheck.fit.effects.evidence import WIDTHS
from crosscheck.fit.least_squares.state import evaluate
from crosscheck.fit.preparation.prepare import prepare
from crosscheck.fit.reasons import DiagnosisVerdict, Why
from crosscheck.given import considered
from crosscheck.measurements.data import Measurements
from seecr.commands.loads import Loads
from seecr.description.mjcf import load_robot
from seecr.effects import Term, Terms
from seecr.effects.knowledge import Knowledge
from seecr.pose import Array

ROBOT = load_robot(COGIRO)
# Of all effects those that imitate what is asked for here: the others cost a minute.
FEW = considered(
    ["pulley_radius", "length_scale", "stiffness", "tracker_scale", "drum_gain", "exit_point_error"]
)


def fitted(*terms: Term) -> tuple[Setting, JointFit]:
    problem = prepare(ROBOT, measured(ROBOT, terms, points=4), Terms()).problem
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem), weight=np.ones(len(problem.row_of)))
    state = evaluate(problem, Terms(terms), factor)
    return setting, settle(setting, state, widths_of(Terms(terms)), WHITE)


def averaged_density(y: Array, columns: Array, widths: tuple[float, ...]) -> float:
    """ln of the density of readings, all that moves them integrated out by covariances."""
    densities = [
        stats.multivariate_normal.logpdf(y, cov=np.eye(len(y)) + w**2 * columns @ columns.T)
        for w in widths
    ]
    return float(special.logsumexp(densities) - np.log(len(widths)))


def test_the_odds_are_those_of_the_covariances() -> None:
    setting, joint = fitted(term(ROBOT, "tracker_scale", factor=1.003))
    scores = Scores(gram_of(joint.jacobian, joint.state.white, {}), 26)
    found = field_in_place(setting, joint, {"tracker_scale": 0.3}, scores)
    y = joint.state.white + joint.jacobian @ joint.z
    parts = varying(setting, joint)
    fields = [averaged_density(y, columns, FIELD_WIDTHS) for _what, columns in parts]
    without = averaged_density(y, joint.jacobian, WIDTHS)
    prior = scores.log_prior(frozenset()) - scores.log_prior(frozenset({"tracker_scale"}))
    expected = float(special.logsumexp(fields)) - np.log(len(parts)) - without + prior
    assert found.odds == pytest.approx(expected, abs=1e-3)
    assert found.replaced == {"tracker_scale"} and found.seen[0] is Varying.POSITION
    assert found.odds < UNKNOWN and found.chance == 0.0 and not found.worth


@pytest.mark.parametrize(
    ("odds", "doubt", "chance"),
    [
        (-np.inf, False, 0.0),
        (2.0, False, 0.0),
        (2.1, True, 0.0),
        (3.85, True, 0.0),
        (3.95, False, 0.259),
        (6.0, False, 0.731),
    ],
)
def test_a_field_is_a_doubt_from_one_in_twenty_on_and_leaves_it_open_from_one_in_four_on(
    odds: float, doubt: bool, chance: float
) -> None:
    found = Imitated(odds, frozenset("a"), (Varying.POSITION,))
    assert found.is_doubt is doubt and found.chance == pytest.approx(chance, abs=1e-3)


def test_of_a_model_nothing_is_replaced() -> None:
    setting, joint = fitted(term(ROBOT, "tracker_scale", factor=1.003))
    scores = Scores(
        gram_of(joint.jacobian, joint.state.white, {}), 26, frozenset(joint.terms.names)
    )
    assert field_in_place(setting, joint, {}, scores) == NOT_ASKED
    setting, joint = fitted()
    assert field_in_place(setting, joint, {}, scores) == NOT_ASKED


def widening(terms: list[Term], times: float) -> Measurements:
    """Read by a tracker whose picture widens to its edges, by so many times its noise."""
    data = measured(ROBOT, terms, points=10)
    off = data.position - data.position.mean(axis=0)
    off /= np.linalg.norm(off, axis=1).max()
    assert SIGMA.position_m is not None
    far = 2.0 * times * SIGMA.position_m * off * (off**2).sum(axis=1, keepdims=True)
    return replace(data, position=data.position + far)


@pytest.mark.slow
def test_a_picture_that_widens_is_unknown_and_what_is_hidden_beside_it_named() -> None:
    data = widening([term(ROBOT, "pulley_radius", radius_m=0.006)], 8.0)
    found = diagnose(ROBOT, data, only=FEW)
    assert found.verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    assert [missing.effect for missing in found.missing] == ["pulley_radius"]
    assert found.missing[0].values[0] == pytest.approx(0.006, rel=0.05)
    assert f", which can imitate it: {Varying.POSITION}" in found.sentence and found.where
    assert found.chances is not None and found.chances.field is not None
    assert found.chances.field > UNKNOWN and found.chances.shown is None
    assert found.chances.words == "" and found.chances.imitated is not None
    unknown = found.as_json()["unknown"]
    assert unknown["seen_in"] == "position" and "stiffness" in unknown["instead_of"]
    (why,) = (c.why_not for c in found.candidates if c.effect == "stiffness")
    assert why is not None and why.why is Why.MAY_IMITATE
    assert found.chances.of("pulley_radius") > 0.95 > 0.05 > found.chances.of("stiffness")


@pytest.mark.slow
def test_what_steps_find_is_asked_too() -> None:
    """Where they end with noise, all that they found would be sure."""
    data = widening([], 8.0)
    ready = prepare(ROBOT, data, Terms(), FEW)
    assert ready.refusal is None
    sought = search_sets(ready.problem, SIGMA)
    assert sought.judgement.imitated is not None and sought.judgement.sure == ()
    assert diagnose(ROBOT, data, only=FEW).verdict is DiagnosisVerdict.UNKNOWN_EFFECT


@pytest.mark.slow
def test_a_hose_is_unknown_and_what_is_hidden_beside_it_named() -> None:
    """A tilt with other stiffnesses, drums and lengths had been found in its place."""
    data = sprung([term(ROBOT, "pulley_radius", radius_m=0.006)], 2.0)
    found = diagnose(ROBOT, data, only=FEW)
    assert found.verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    assert [missing.effect for missing in found.missing] == ["pulley_radius"]
    assert f", which can imitate it: {Varying.SPRING}" in found.sentence
    assert any("take hoses and leads off the platform" in line for line in found.measure_next)


def sprung(terms: list[Term], times: float) -> Measurements:
    """Of a platform that a soft spring pulls, which moves it by about so many times the noise."""
    plain = measured(ROBOT, terms, points=10)
    force = -0.5 * times * ROBOT.weight * (plain.command_pose[:, :3] - np.array([0.5, 0.2, 0.3]))
    loads = Loads.of(plain.n_rows, wrench=np.hstack([force, 0.0 * force]))
    return measured(ROBOT, terms, points=10, loads=loads)


def test_equals_of_what_imitates_are_doubted_as_well() -> None:
    classes = Classes(
        {"a": 0.99, "b": 0.6, "c": 0.4, "d": 0.1}, [("a",), ("b", "c"), ("d",)],
        [0.99, 0.98, 0.1], {"c": 0.5},
    )  # fmt: skip
    less = classes.without(frozenset({"b"}), 0.75)
    assert less.probability == pytest.approx([0.99, 0.245, 0.1])
    assert less.effect == pytest.approx({"a": 0.99, "b": 0.15, "c": 0.1, "d": 0.1})
    assert less.further == pytest.approx({"c": 0.125}) and less.members == classes.members
    assert classes.without(frozenset(), 0.75).probability == classes.probability


def test_a_member_that_only_the_field_leaves_positive_is_weighed_beside_it() -> None:
    """Without, what nobody knows pushes it far below nothing, which costs what it should not."""
    random = np.random.default_rng(3)
    x = 30.0 * random.standard_normal((80, 2))
    x[:, 1] = 0.8 * x[:, 0] + 0.2 * x[:, 1]
    field = x[:, :1] * 1.0 + 0.1 * random.standard_normal((80, 1))
    groups = {
        "pulley_radius": ColumnGroup(np.array([1]), np.array([1.0]), one_sided=np.array([True])),
        "field": ColumnGroup(np.array([2]), np.array([1.0])),
    }
    y = x[:, 1] - 3.0 * field[:, 0] + random.standard_normal(80)
    gram = gram_of(np.concatenate([x, field], axis=1), y, groups)
    alone, both = {"pulley_radius": 1.0}, {"pulley_radius": 1.0, "field": 1.0}
    assert gram.solved(alone).values[0] < -0.5 < 0.5 < gram.solved(both).values[0]
    fields = {"field": Varying.POSITION}
    sets = _Sets(gram, fields, Scores(gram, 26), alone, {"pulley_radius": 0.0})
    names = frozenset(alone)
    expected = gram.solved(both).log_evidence + sets.scores.log_prior(names)
    assert sets.beside(names)[0] == pytest.approx(expected, abs=1e-6)


def test_members_worth_nothing_are_left_out_first() -> None:
    """Each would have its prior counted for what stands in its place."""
    random = np.random.default_rng(4)
    x = random.standard_normal((200, 3))
    names = ("a", "b", "c")
    groups = {n: ColumnGroup(np.array([k]), np.array([1.0])) for k, n in enumerate(names)}
    gram = gram_of(x, 3.0 * x[:, 0] + random.standard_normal(200), groups)
    chosen = dict.fromkeys(names, 1.0)
    sets = _Sets(gram, {}, Scores(gram, 26), chosen, dict.fromkeys(names, 0.0))
    assert sets.needed(frozenset(names)) == {"a"}
    kept = replace(sets, scores=Scores(gram, 26, frozenset("b")))
    assert kept.needed(frozenset(names)) == {"a", "b"}
    priced = replace(sets, scores=Scores(gram, 26, prices={"a": 1e4}))
    assert "a" not in priced.needed(frozenset(names))


def toy(worthless: float = 0.0) -> tuple[_Sets, Array, Array]:
    """Sets in whose truth a field acts, which "a" and "b" imitate, and "c", and "d" if asked."""
    random = np.random.default_rng(5)
    x = 4.0 * random.standard_normal((60, 5))
    x[:, 4] = x[:, 0] - x[:, 1] + 0.4 * random.standard_normal(60)
    names = ("a", "b", "c", "d", "field")
    groups = {n: ColumnGroup(np.array([k]), np.array([1.0])) for k, n in enumerate(names)}
    y = 2.0 * x[:, 4] + 0.4 * x[:, 2] + worthless * x[:, 3] + random.standard_normal(60)
    chosen = dict.fromkeys(names[:4], 1.0)
    gram = gram_of(x, y, groups)
    fields = {"field": Varying.FORCE}
    return _Sets(gram, fields, Scores(gram, 26), chosen, dict.fromkeys(chosen, 0.0)), x, y


def asked(sets: _Sets, monkeypatch: pytest.MonkeyPatch, **of: Any) -> Imitated:
    """`field_in_place` of given sets."""
    monkeypatch.setattr(_Sets, "of", lambda *_: sets)
    joint = SimpleNamespace(terms=SimpleNamespace(names=tuple(sets.chosen)))
    return field_in_place(cast(Setting, None), cast(JointFit, joint), {}, sets.scores)


def test_what_it_replaces_and_what_the_others_are_worth_are_those_of_the_covariances(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sets, x, y = toy()
    found = asked(sets, monkeypatch)

    def total(*columns: int) -> float:
        """ln density and prior: the fifth column is the field's, and counts for nothing."""
        count = len([k for k in columns if k < 4])
        return averaged_density(y, x[:, list(columns)], (1.0,)) + log_prior(count, 26)

    assert found.replaced == {"a", "b"} and found.seen == (Varying.FORCE,) and found.chance > 0.9
    assert found.odds == pytest.approx(total(2, 4) - total(0, 1, 2), abs=1e-6)
    assert found.worth == pytest.approx({"c": total(2, 4) - total(4)}, abs=1e-6)


def test_what_explains_about_as_well_is_told_as_well() -> None:
    sets, _x, _y = toy()
    fields = {"a": Varying.POSITION, "b": Varying.WINCHES, "c": Varying.POSITION}
    every = replace(sets, fields=fields)
    both = (Varying.POSITION, Varying.WINCHES)
    assert every._likely({"a": 0.0, "b": -19.0, "c": -np.inf}) == both
    assert every._likely({"a": -70.0, "b": -46.0, "c": -80.0}) == (Varying.WINCHES,)
    many = replace(sets, fields=dict(zip("abcd", Varying, strict=False)))
    assert len(many._likely(dict.fromkeys("abcd", 0.0))) == 3
    # each by what all of its fields have together
    assert every._likely({"a": 0.0, "b": 0.5, "c": 0.0})[0] is Varying.POSITION
    two = Imitated(6.0, frozenset("a"), (Varying.POSITION, Varying.WINCHES))
    assert two.words == f"{Varying.POSITION}; or {Varying.WINCHES}"


def test_what_is_worth_nothing_is_not_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its prior would be counted for the field; beside one that explains it, it is kept."""
    sets, _x, _y = toy()
    with_all = sets.whole(frozenset("abcd"))
    assert sets.whole(frozenset("abc")) > with_all + 2.0
    assert "d" not in asked(sets, monkeypatch).worth
    there = asked(toy(1.0)[0], monkeypatch)
    assert there.replaced == {"a", "b"} and sorted(there.worth) == ["c", "d"]


def test_no_field_moves_what_was_measured_independently() -> None:
    alone = term(ROBOT, "tracker_scale", factor=1.003)
    knowledge = replace(Knowledge.nothing(1), value=np.array([1.002]), stderr=np.array([1e-4]))
    setting, joint = fitted(replace(alone, knowledge=knowledge))
    gram, names = _with_fields(setting, joint)
    first = next(name for name, what in names.items() if what is Varying.READINGS)
    own = gram.groups[first].columns
    columns = field_of(setting.problem, joint.state.prediction.pose[:, :3])
    assert (
        list(names.values()) == [what for what, _ in varying(setting, joint)]
        and len(own) == columns.shape[1]
    )
    assert gram.normal[np.ix_(own, own)] == pytest.approx(columns.T @ columns, abs=1e-9)
    assert gram.normal[own, 0] == pytest.approx(columns.T @ joint.jacobian[:, 0], abs=1e-9)
    # which does count as a reading of the effect itself
    assert gram.normal[0, 0] > 1.01 * joint.jacobian[:, 0] @ joint.jacobian[:, 0]


def with_a_lens() -> tuple[Setting, JointFit]:
    """A tracker's lens seen from above: its picture bends by ten times the noise, mostly evenly."""
    setting, joint = fitted(term(ROBOT, "tracker_scale", factor=1.0))
    place = joint.state.prediction.pose[:, :3]
    off = (place - place.mean(axis=0)) / (0.5 * np.ptp(place, axis=0).max()) - [0.3, 0.2, 4.0]
    bent = off * np.sum(off**2, axis=1, keepdims=True)
    problem = setting.problem
    read = np.zeros(problem.measured.shape)
    read[:, :3] = bent - bent.mean(axis=0)
    signal = problem.whiten(setting.factor, read)
    noise = np.random.default_rng(2).standard_normal(len(signal))
    white = noise + 10.0 * signal / np.sqrt(np.mean(signal**2))
    return setting, replace(joint, state=replace(joint.state, white=white))


def evidence(setting: Setting, joint: JointFit) -> float:
    """ln evidence of what is unknown and nothing else."""
    scores = Scores(gram_of(joint.jacobian, joint.state.white, {}), 26)
    return _Sets.of(setting, joint, {}, scores).beside(frozenset())[0]


def test_a_lens_earns_more_with_smaller_coefficients_of_higher_degrees(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    setting, joint = with_a_lens()
    round_too = evidence(setting, joint)
    monkeypatch.setattr(anywhere, "_of_lens", lambda *_: iter(()))
    found = evidence(setting, joint)
    # what is known to be round has fewer still
    assert round_too > found + 5.0
    monkeypatch.setattr(anywhere, "SMOOTH", 1.0)
    assert found > evidence(setting, joint) + 10.0


def test_what_keeps_hardly_anything_of_its_worth_beside_something_unknown_is_not_there() -> None:
    """A lag of the readings once left 11 of backlash's 1294, and backlash was named for certain."""
    best = frozenset({"backlash", "tilt"})
    worth = {frozenset({"tilt"}): -1294.0, frozenset({"backlash"}): -174.0}
    scores = SimpleNamespace(score=lambda names: worth.get(names, 0.0))
    found: Any = SimpleNamespace(best=SimpleNamespace(names=best), scores=scores)
    lag = Imitated(173.0, frozenset(), (Varying.LAG,), {"backlash": 11.4, "tilt": 171.0})
    assert _outdone(found, lag) == {"backlash"}
    assert _outdone(found, NOT_ASKED) == frozenset()


def test_what_has_no_probability_left_is_not_listed() -> None:
    """Beside winches that turn with others a platform's mass was, with a probability of zero."""
    lag = Imitated(173.0, frozenset({"pulley_radius"}), (Varying.LAG,))
    said = Judgement(DiagnosisVerdict.UNKNOWN_EFFECT, ("backlash", "tilt"), 0.0, imitated=lag)
    left, gone = _still_there(said, frozenset({"backlash"}), likelier=True)
    assert left.sure == ("tilt",) and gone == {"backlash"}
    # where nothing is in place of known effects, what outweighs the unknown stays
    alone = Judgement(DiagnosisVerdict.UNKNOWN_EFFECT, ("tilt",), 0.0)
    both = frozenset({"tilt", "backlash"})
    assert _still_there(alone, both, likelier=True) == (alone, {"backlash"})
    # what is less likely than the members it replaces, and not told, takes nothing from others
    assert _still_there(alone, both, likelier=False) == (alone, frozenset())
