"""Results on the terminal: one line per fact, none broken, units in the headings."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import made_diagnoses as made
import pytest
from made_data import measured, soft_cogiro, term

from crosscheck.add import add_effect
from crosscheck.calibration import calibrate
from crosscheck.comparison.residuals import compare
from crosscheck.comparison.result import Comparison
from crosscheck.fit.reasons import Reason, Why
from crosscheck.show.comparison import print_comparison
from crosscheck.show.diagnosis import print_diagnosis
from crosscheck.show.findings import candidate_rows
from crosscheck.show.models import print_calibration, why_not
from seecr.description.mjcf import load_robot
from seecr.prediction.experiment import predict


def printed(show: Callable[..., None], *what: Any) -> str:
    with redirect_stdout(StringIO()) as out:
        show(*what)
    return out.getvalue()


@pytest.fixture(scope="module")
def found() -> Comparison:
    robot = soft_cogiro()
    return compare(robot, measured(robot, [term(robot, "stiffness", factor=1.4)]))


def test_a_comparison_begins_with_verdict_and_limits(found: Comparison) -> None:
    text = printed(print_comparison, found, [], True, Path("here"))
    lines = text.splitlines()
    assert lines[:2] == [found.sentence, "All limits hold."] and lines[-1] == "Results in here/"
    assert sum(line.startswith("worst: line ") for line in lines) == 5
    head = next(line for line in lines if line.startswith("measured minus predicted"))
    assert head.split()[-4:] == ["unit", "at", "line", "rows"]
    z = next(c for c in found.coordinates if c.name == "z")
    row = next(line.split() for line in lines if line.startswith("z "))
    assert row == ["z", *(f"{1e3 * v:.4g}" for v in (z.bias, z.rms, z.max)), "mm",
                   str(z.line), str(z.rows)]  # fmt: skip


def test_what_rounding_leaves_of_an_error_is_nothing() -> None:
    """The readings are those of the model: errors were told as 3e-11 mm."""
    robot = soft_cogiro()
    data = measured(robot)
    told = predict(robot, data).readings
    exact = replace(data, position=told.position + 3e-14, quat_wxyz=told.quat_wxyz)
    text = printed(print_comparison, compare(robot, exact), [], False, Path("here"))
    row = next(line.split() for line in text.splitlines() if line.startswith("x "))
    assert row[1:5] == ["0", "0", "0", "mm"]


@pytest.mark.parametrize(
    ("effect", "words"),
    [
        (
            "winch_side_length",
            "winch_side_length comes out at its null values: it is not worth adding; --force",
        ),
        ("platform_mass", r"platform_mass is 0\.\d+ standard errors from null: it is not worth"),
        ("drum_gain", r"may bring 2 values \(0\.\d+ standard errors, all together\): it"),
    ],
)
def test_what_is_nothing_says_in_which_way(effect: str, words: str) -> None:
    robot = load_robot("planar_two_cable")
    data = measured(robot, [term(robot, "pulley_radius", radius_m=0.01)], points=6)
    assert re.search(words, why_not(add_effect(robot, data, effect)))


@pytest.mark.parametrize("sure", [False, True])
def test_a_calibration_tells_of_every_effect_how_sure_it_is(sure: bool) -> None:
    """With two cables all of them can stand in for one another, and none looked like anything."""
    robot = load_robot("planar_two_cable")
    data = measured(robot, [term(robot, "stiffness", factor=1.3)], points=6)
    names = ("stiffness", "platform_mass", "length_scale", "tracker_frame")
    found = calibrate(robot, data, only=names[:1] if sure else names)
    text = printed(print_calibration, found, Path("m.toml"), True)
    rows = [line.split() for line in text.splitlines()]
    sizes = {row[0]: row[2] for row in rows if len(row) == 3 and row[0] in names}
    assert len(sizes) == len(found.fitted) and "-" not in sizes.values()
    assert any(float(size) > 3.0 for size in sizes.values()) == sure
    assert ("No single effect differs from null by 3 standard errors" in text) != sure


def test_a_calibration_says_what_it_did_not_fit_and_why() -> None:
    """Of 27 effects 17 were in a model of "all that the data see"; of ten nothing was said."""
    robot = load_robot("planar_two_cable")
    data = measured(robot, [term(robot, "stiffness", factor=1.3)], points=6)
    found = calibrate(robot, data, only=["stiffness", "exit_friction", "tension_scale"])
    text = printed(print_calibration, found, Path("m.toml"), True)
    said = {name: why.why for name, why in found.absent.items() if why.why is not Why.EXCLUDED}
    assert said == {"exit_friction": Why.GAINS_NOTHING, "tension_scale": Why.NEEDS_TENSIONS}
    lines = [line for line in text.splitlines() if line.startswith("not fitted: ")]
    assert lines == [
        "not fitted: exit_friction (explains nothing beside the others)",
        "not fitted: tension_scale (needs measured tensions)",
    ]
    assert found.as_json()["not_fitted"].keys() == found.absent.keys()
    assert set(found.terms.names).isdisjoint(found.absent)


def test_a_diagnosis_says_how_probable_what_it_does_not_print_is_at_most() -> None:
    whole = made.pulleys()
    assert whole.chances is not None
    asked = [row for row in whole.candidates if row.why_not.why is not Why.EXCLUDED]
    effect = dict.fromkeys(whole.chances.effect, 0.02) | {asked[-1].effect: 0.31}
    for rows, more in (
        (whole.candidates, f"nor {len(asked) - 6} others (probability 31 % or less): see "),
        (asked[:6], ""),
    ):
        chances = replace(whole.chances, effect=effect)
        found = replace(whole, candidates=rows, chances=chances)
        text = printed(print_diagnosis, found, Path("here"))
        lines = [line for line in text.splitlines() if line.startswith("nor ")]
        assert lines == ([f"{more}candidates in diagnosis.json"] if more else [])


def test_what_is_probable_and_not_listed_is_named_with_its_probability() -> None:
    """Of a tracker's frame at > 99 % one read "nor 21 others (probability > 99 % or less)"."""
    whole = made.pulleys()
    assert whole.chances is not None
    asked = [row for row in whole.candidates if row.why_not.why is not Why.EXCLUDED]
    first, second, other = asked[0], asked[1], asked[-1].effect
    rows = [
        replace(first, why_not=Reason(Why.IMPROBABLE, p=0.999)),
        replace(second, why_not=Reason(Why.NOT_SURE, p=0.7)),
        *asked[2:],
    ]
    likely = {first.effect: 0.999, second.effect: 0.7, other: 0.998}
    effect = dict.fromkeys(whole.chances.effect, 0.02) | likely
    chances = replace(whole.chances, effect=effect)
    text = printed(print_diagnosis, replace(whole, candidates=rows, chances=chances), Path("here"))
    lines = [line for line in text.splitlines() if line.startswith(("not ", "nor "))]
    assert lines[0].endswith("explains too little (probability > 99 %)")
    assert lines[1] == f"not {second.effect}: probable (70 %) but not certain"
    assert f"(probability: {other} > 99 %, others 2 % or less)" in lines[-1]


def test_a_diagnosis_begins_with_its_verdict() -> None:
    found = made.pulleys()
    text = printed(print_diagnosis, found, Path("here"))
    lines = text.splitlines()
    assert lines[0] == f"effects_found: {found.sentence}"
    assert any(line.startswith("In these data ") for line in lines)
    assert any(line.startswith("pulley_radius: ") for line in lines)
    assert any(line.startswith("not ") for line in lines) and lines[-1].startswith("Results in")


def test_classes_of_equals_are_told_with_their_probability_where_none_is_listed() -> None:
    whole = made.pulleys()
    assert whole.chances is not None
    single = {name: 0.4 for name in ("stiffness", "platform_mass")}
    classes = (
        (("pulley_radius", "length_scale"), 0.999),  # one of it is listed
        (("stiffness", "platform_mass"), 0.8),
        (("gravity_tilt",), 0.3),
        (("drum_gain", "tracker_scale"), 0.01),
    )
    effect = whole.chances.effect | single | {"gravity_tilt": 0.3}
    found = replace(whole, chances=replace(whole.chances, effect=effect, classes=classes))
    text = printed(print_diagnosis, found, Path("here"))
    told = [line for line in text.splitlines() if line.startswith("one of ")]
    assert told == ["one of stiffness, platform_mass: probability 80 %"]
    rows = {row["effect"][0]: row["#probability"] for row in candidate_rows(found)}
    assert rows["stiffness"] == ["40 %", "with equivalents 80 %"]
    assert rows["gravity_tilt"] == ["30 %"]


def test_what_was_left_out_as_asked_is_not_told_again() -> None:
    text, whole = "", made.pulleys()
    asked = [
        replace(row, why_not=Reason(Why.EXCLUDED)) if row.effect == "creep" else row
        for row in whole.candidates
    ]
    for rows in (asked[:3], [row for row in asked if row.effect == "creep"]):
        text += printed(print_diagnosis, replace(whole, candidates=rows), Path("here"))
    lines = [line for line in text.splitlines() if line.startswith("not ")]
    told = {line.split()[1].rstrip(":") for line in lines}
    assert told == {row.effect for row in asked[:3]} - {"creep"}
