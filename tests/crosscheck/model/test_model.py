"""Model files: what is written is read back, and what is wrong is said with its line."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import tomlkit
from made_data import COGIRO, measured, term

from crosscheck.model.fitted import Fitted
from crosscheck.model.write import Provenance, calibrated, renewed, save_model, with_fit
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import catalogue, layout_of
from seecr.effects.base import range_of
from seecr.errors import InputFileError
from seecr.prediction.experiment import predict
from seecr.prediction.model import load_model, new_model
from seecr.prediction.uncertainty import covariance_of

SOURCE = Provenance("measured.csv", "2024-05-13", "seecr 0.1.0", "crosscheck add pulley_radius")
ERRORS = {
    "before": {"position_rms_m": 0.0025, "tension_rms_N": None},
    "after": {"position_rms_m": 3e-5, "tension_rms_N": None},
    "held_out": {"position_rms_m": 3.1e-5, "tension_rms_N": None},
}


@pytest.fixture(scope="module")
def robot():
    return load_robot(COGIRO)


def fitted(robot, name, error=1e-4, bound=False, **values):
    one = term(robot, name, **values)
    count = len(one.layout)
    return Fitted(one, np.full(count, error), np.full(count, bound))


@pytest.fixture
def saved(robot, tmp_path):
    pulley = fitted(robot, "pulley_radius", radius_m=0.01)
    model = with_fit(new_model(robot), [pulley], ["pulley_radius"], SOURCE, ERRORS)
    path = tmp_path / "model.toml"
    save_model(path, model)
    return path


def changed(path, old, new):
    text = path.read_text()
    assert text.count(old) >= 1, old
    path.write_text(text.replace(old, new, 1))
    return path


def error_of(path, robot):
    with pytest.raises(InputFileError) as error:
        load_model(path, robot)
    text = str(error.value)
    assert "\n" not in text and text.startswith(str(path))
    return text


def test_a_saved_model_is_read_back(robot, saved):
    model = load_model(saved, robot)
    assert model.names == ("pulley_radius",)
    assert model.terms["pulley_radius"].vector == pytest.approx([0.01])
    assert model.stderr["pulley_radius"] == pytest.approx([1e-4])
    assert model.notes == ()
    text = saved.read_text()
    assert 'radius_m = { value = 0.01, stderr = 0.0001, unit = "m", at_bound = false }' in text
    assert 'data = "measured.csv"' in text and 'date = "2024-05-13"' in text
    assert "[effect.before]\nposition_rms_m = 0.0025\n" in text
    assert "tension_rms_N" not in text


def test_values_keep_their_digits(robot, tmp_path):
    values = {"radius_m": 0.0099123456789}
    model = with_fit(
        new_model(robot), [fitted(robot, "pulley_radius", **values)], ["pulley_radius"], SOURCE,
        ERRORS,
    )  # fmt: skip
    save_model(tmp_path / "m.toml", model)
    back = load_model(tmp_path / "m.toml", robot).terms["pulley_radius"].vector[0]
    assert abs(back / values["radius_m"] - 1.0) < 1e-9


def test_what_is_unseen_is_said_so(robot, tmp_path):
    unseen = fitted(robot, "pulley_radius", error=np.inf, bound=True, radius_m=0.0)
    model = with_fit(new_model(robot), [unseen], ["pulley_radius"], SOURCE, ERRORS)
    save_model(tmp_path / "m.toml", model)
    assert 'stderr = "unseen", unit = "m", at_bound = true' in (tmp_path / "m.toml").read_text()
    assert np.isinf(load_model(tmp_path / "m.toml", robot).stderr["pulley_radius"][0])


def test_comments_survive_another_effect(robot, saved):
    changed(saved, "[[effect]]", "# measured with the old tracker\n[[effect]]")
    changed(saved, "at_bound = false }", "at_bound = false } # caliper: 9.9 mm")
    model = load_model(saved, robot)
    both = [
        fitted(robot, "stiffness", factor=1.2),
        fitted(robot, "pulley_radius", radius_m=0.011),
    ]
    again = replace(SOURCE, by="crosscheck add stiffness")
    save_model(saved, with_fit(model, both, ["stiffness"], again, ERRORS))
    text = saved.read_text()
    assert "# measured with the old tracker" in text and "# caliper: 9.9 mm" in text
    back = load_model(saved, robot)
    assert back.names == ("pulley_radius", "stiffness")
    assert back.terms["pulley_radius"].vector == pytest.approx([0.011])
    tables = tomlkit.parse(text)["effect"]
    assert tables[0]["provenance"]["by"] == "crosscheck add pulley_radius"
    assert tables[0]["refitted"]["by"] == "crosscheck add stiffness"
    assert "refitted" not in tables[1]
    # the model that was read is as it was
    assert model.names == ("pulley_radius",)


def test_comments_survive_in_tables_that_a_fit_writes_anew(robot, tmp_path):
    path, names = tmp_path / "m.toml", ["pulley_radius"]
    one, covariance = [fitted(robot, *names, radius_m=0.01)], np.array([[1e-8]])
    for kind in ("fit", "calibration"):
        model = with_fit(new_model(robot), one, names, SOURCE, ERRORS, covariance)
        if kind == "calibration":
            model = calibrated(new_model(robot), one, covariance, SOURCE, ERRORS)
        save_model(path, renewed(model, robot, measured(robot)))
        changed(path, f"[{kind}]", f"[{kind}]\n# after the new spools")
        changed(path, "[fitted_to]", "[fitted_to]\n# the whole frame")
        changed(path, 'date = "2024-05-13"', 'date = "2024-05-13" # a Monday')
        changed(path, "after]", "after]\n# without the outlier")
        model = load_model(path, robot)
        read = model.document.as_string()
        if kind == "fit":
            again = with_fit(model, one, names, SOURCE, ERRORS, covariance)
        else:
            again = calibrated(model, one, covariance, SOURCE, ERRORS)
        save_model(path, renewed(again, robot, measured(robot)))
        assert model.document.as_string() == read  # the model that was read is as it was
        text = path.read_text()
        assert f"[{kind}]\n" in text and "after]\n# without the outlier" in text
        for remark in ("# after the new spools", "# the whole frame", "# a Monday"):
            assert text.count(remark) == 1, text
        assert text.count("# Standard errors of the values above") == (kind == "fit")
        assert covariance_of(load_model(path, robot)) == pytest.approx(covariance)


def test_a_person_may_write_one_by_hand(robot, tmp_path):
    path = tmp_path / "m.toml"
    path.write_text('[[effect]]\nname = "stiffness"\nparameters.factor = 1.4\n')
    model = load_model(path, robot)
    assert model.terms["stiffness"].vector == pytest.approx([1.4])
    assert "which robot" in model.notes[0]


def test_a_parameter_that_had_another_name_is_read_and_written_under_that_of_today(robot, tmp_path):
    path = tmp_path / "model.toml"
    path.write_text(
        '[[effect]]\nname = "frame_compliance"\n'
        "parameters = { compliance_m_per_N = { value = 2e-5, stderr = 1e-6 } }\n"
    )
    model = load_model(path, robot)
    assert model.terms["frame_compliance"].vector == pytest.approx([2e-5, 2e-5])
    assert model.stderr["frame_compliance"] == pytest.approx([1e-6, 1e-6])
    said = "compliance_m_per_N of an older version is read as sideways_m_per_N and upwards_m_per_N"
    assert any(said in note for note in model.notes)
    save_model(path, model)
    assert "compliance_m_per_N" not in path.read_text() and "upwards_m_per_N" in path.read_text()
    assert not any("older version" in note for note in load_model(path, robot).notes)


def test_effects_put_in_from_python_are_written(robot, tmp_path):
    path, weight = tmp_path / "model.toml", term(robot, "cable_weight", weight_N_per_m=6.0)
    save_model(path, replace(new_model(robot), terms=new_model(robot).terms.with_term(weight)))
    model = load_model(path, robot)
    assert model.terms["cable_weight"].vector == pytest.approx([6.0])
    assert np.isnan(model.stderr["cable_weight"]).all()
    assert "stderr" not in path.read_text() and "weight" in str(model)


def test_cells_that_are_fitted_again_keep_their_spaces_and_what_people_wrote(robot, tmp_path):
    path = tmp_path / "model.toml"
    path.write_text(
        '[[effect]]\nname = "pulley_radius"\n[effect.parameters]\n'
        "radius_m = { value = 0.01, known = { value = 0.01, stderr = 1e-3 } } # by caliper\n"
    )
    one = Fitted(term(robot, "pulley_radius", radius_m=0.0099), np.array([1e-4]), np.array([False]))
    save_model(path, with_fit(load_model(path, robot), [one], [], SOURCE, ERRORS))
    line = next(text for text in path.read_text().splitlines() if text.startswith("radius_m"))
    assert line == (
        "radius_m = { value = 0.0099, known = { value = 0.01, stderr = 1e-3 }, stderr = 0.0001, "
        'unit = "m", at_bound = false } # by caliper'
    )


def test_effects_changed_or_taken_out_in_python_are_written_so(robot, saved):
    model = load_model(saved, robot)
    more = replace(model, terms=model.terms.with_term(term(robot, "pulley_radius", radius_m=0.02)))
    save_model(saved, more)
    again = load_model(saved, robot)
    assert again.terms["pulley_radius"].vector == pytest.approx([0.02])
    assert np.isnan(again.stderr["pulley_radius"]).all()  # those were of another value
    save_model(saved, replace(again, terms=type(again.terms)()))
    assert load_model(saved, robot).names == ()


def test_no_model_is_no_effect(robot, tmp_path):
    save_model(tmp_path / "new" / "m.toml", new_model(robot))
    assert not load_model(tmp_path / "new" / "m.toml", robot).terms


BAD = {
    "broken": ("name = ", "name = = ", r"is not TOML: Invalid value \(at line \d+, column 8\);"),
    "unknown effect": (
        '"pulley_radius"', '"pully_radius"',
        r"line \d+: no effect 'pully_radius'; known, nearest first: pulley_radius, ",
    ),
    "a name that is none": ('name = "pulley_radius"', "name = [1]", r"line \d+: expected name"),
    "no name": ('name = "pulley', 'label = "pulley', r"line \d+: expected name"),
    "unknown parameter": (
        "radius_m = ", "radius_mm = ",
        r"line \d+: effect pulley_radius: unknown parameter radius_mm; .*first: radius_m$",
    ),
    "missing parameter": (
        "radius_m = {", "# radius_m = {", r"line \d+: .* parameter radius_m is missing",
    ),
    "no number": ("value = 0.01", 'value = "ten"', r"radius_m: expected a number, got 'ten'"),
    "not finite": ("value = 0.01", "value = nan", r"radius_m: expected a number, got nan"),
    "out of bounds": (
        "value = 0.01", "value = -0.01",
        r"line \d+: .* radius_m: -0.01 is out of bounds; expected 0 to 0\.\d+$",
    ),
    "wrong unit": ('unit = "m"', 'unit = "mm"', r"radius_m: expected unit 'm', got 'mm'"),
    "bad error": ("stderr = 0.0001", "stderr = -1", r"stderr must be a number from 0 to 1e\+30 or"),
    "no error": ("stderr = 0.0001", "stderr = 1e300", r"0 to 1e\+30 or \"unseen\", got 1e\+300$"),
    "odd word": ("at_bound", "atbound", r"unknown atbound; expected at_bound, .*nearest first"),
    "misspelt table": (
        "[[effect]]", "[[effects]]\n[[effect]]", r"line \d+: unknown effects; expected effect",
    ),
    "newer": ("format = 1", "format = 2", r"format 2 is not known to this version"),
}  # fmt: skip


@pytest.mark.parametrize("kind", BAD)
def test_bad_models_are_refused_with_their_line(kind, robot, saved):
    old, new, words = BAD[kind]
    assert re.search(words, error_of(changed(saved, old, new), robot))


def test_the_line_is_that_of_the_effect_meant(robot, saved):
    text = saved.read_text()
    extra = '\n[[effect]]\nname = "stiffness"\n[effect.parameters]\nfactor = 0.001\n'
    saved.write_text(text + extra)
    line = (text + extra).splitlines().index("factor = 0.001") + 1
    assert f"line {line}: effect stiffness: factor: 0.001 is out of bounds" in error_of(
        saved, robot
    )


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("centre_of_mass", "shift_x_m = 0.002",
         "parameters shift_y_m, shift_z_m are missing; expected a line"),
        # winches are zeroed where somebody can stand
        ("thermal_expansion", "expansion_1_per_K = 1e-5\nzero_temperature_C = 199",
         "zero_temperature_C: 199 is out of bounds; expected -40 to 60"),
        ("tracker_target", "shift_m = -1e300\nrotation_rad = 0.0",
         "shift_x_m: -1e+300 is out of bounds; expected -"),
        ("tracker_target", "shift_m = 0.0\nrotation_rad = 90.0",
         "rotation_x_rad: 90 is out of bounds; expected -6.28"),
    ],
)  # fmt: skip
def test_values_are_all_there_and_of_a_size_that_a_robot_can_have(
    robot, saved, name, values, words
):
    extra = f'\n[[effect]]\nname = "{name}"\n[effect.parameters]\n{values}\n'
    saved.write_text(saved.read_text() + extra)
    assert words in error_of(saved, robot)


def test_every_value_has_finite_limits_that_hold_its_plausible_sizes(robot):
    for effect in catalogue().values():
        layout = layout_of(effect, robot)
        for i in range(len(layout)):
            low, high = range_of(layout, i)
            assert np.isfinite([low, high]).all() and low <= layout.null[i] <= high
            far = layout.null[i] + 30.0 * layout.scale[i] * np.array([-1.0, 1.0])
            far = np.clip(far, layout.lower[i], layout.upper[i])
            assert layout.shape[i] or ((low <= far).all() and (far <= high).all())


def test_an_effect_may_stand_there_once(robot, saved):
    text = saved.read_text()
    saved.write_text(text + text[text.index("[[effect]]") :])
    assert "pulley_radius is listed twice" in error_of(saved, robot)


def test_a_model_made_for_another_robot_is_noticed(robot, saved):
    planar = load_robot(model_path("planar_vertical"))
    assert "made for another robot: demobot_cogiro with 8 cables; " in error_of(saved, planar)
    parallel = load_robot(model_path("demobot_parallel"))
    text = error_of(saved, parallel)
    assert "made for another robot: demobot_cogiro, not demobot_parallel: its exit point of" in text
    assert "mm from that in " in text


def test_points_that_moved_are_another_robot_and_a_new_mass_is_noted(robot, saved):
    exits = robot.exit_points.copy()
    exits[3, 1] += 2e-3
    text = error_of(saved, replace(robot, exit_points=exits))
    assert "of the same name, demobot_cogiro: its exit point of cable4 is 2 mm" in text
    moved = robot.reference_pose.copy()
    moved[0] += 0.01
    assert "reference pose is (0.4" in error_of(saved, replace(robot, reference_pose=moved))
    heavier = load_model(saved, replace(robot, mass=0.5))
    assert heavier.names == ("pulley_radius",)
    assert "mass_kg of robot demobot_cogiro was 0.4; now it is 0.5" in heavier.notes[0]
    # fitting again takes the numbers as they are now
    again = renewed(heavier, replace(robot, mass=0.5), measured(robot))
    save_model(saved, again)
    assert load_model(saved, replace(robot, mass=0.5)).notes == ()


def test_a_file_that_is_not_there_or_no_text(robot, tmp_path):
    assert "no such file" in error_of(tmp_path / "none.toml", robot)
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00")
    assert "is not UTF-8" in error_of(tmp_path / "bytes.toml", robot)
    assert "cannot be read" in error_of(tmp_path, robot)


def test_an_unwritable_place_leaves_the_old_model(robot, saved, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(InputFileError, match="cannot be written"):
        save_model(blocked / "m.toml", new_model(robot))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "model.toml"]


KNOWN = {
    "known without its error": (
        "value = 0.01,", "known = { value = 0.01 },",
        r"radius_m: expected known = \{ value = ..., stderr = ... \}: .*, got \{ value = 0.01 \}",
    ),
    "known is a number": ("value = 0.01,", "known = 0.01,", r"expected known = .*, got 0.01"),
    "known is exact": (
        "value = 0.01,", "known = { value = 0.01, stderr = 0 },",
        r"known: stderr must be a number above 0 and at most .*, got 0; .* fixed = true",
    ),
    "known out of bounds": (
        "value = 0.01,", "known = { value = -0.01, stderr = 1e-3 },",
        r"line \d+: .* radius_m: known: -0.01 is out of bounds; expected 0 to ",
    ),
    "fixed out of bounds": (
        "value = 0.01,", "value = -0.01, fixed = true,", r"radius_m: -0.01 is out of bounds",
    ),
    "unknown word": (
        "value = 0.01,", "value = 0.01, fix = true,",
        r"radius_m: unknown fix; expected fixed, .*nearest first",
    ),
    "unknown word in known": (
        "value = 0.01,", "known = { value = 0.01, stderr = 1e-3, sdterr = 1 },",
        r"radius_m: unknown sdterr in known; expected stderr, value",
    ),
    "both": (
        "value = 0.01,", "value = 0.01, fixed = true, known = { value = 0.01, stderr = 1 },",
        r"radius_m: is both fixed and known; leave one",
    ),
    "neither yes nor no": (
        "value = 0.01,", "value = 0.01, fixed = 1,", r"fixed must be true or false, got 1",
    ),
    "an effect neither yes nor no": (
        "[effect.parameters]", 'fixed = "yes"\n[effect.parameters]',
        r"line \d+: effect pulley_radius: fixed must be true or false, got 'yes'",
    ),
    "misspelt": (
        "[effect.parameters]", "fixd = true\n[effect.parameters]",
        r"line \d+: effect pulley_radius: unknown fixd; expected fixed",
    ),
    "fixed without a value": (
        "value = 0.01,", "fixed = true,", r"radius_m: expected a number, got none",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", KNOWN)
def test_what_is_known_is_said_in_full(kind, robot, saved):
    old, new, words = KNOWN[kind]
    assert re.search(words, error_of(changed(saved, old, new), robot))


def test_known_and_fixed_values_are_read(robot, saved):
    changed(saved, "value = 0.01, stderr = 0.0001,", "known = { value = 0.03, stderr = 0.0005 },")
    known = load_model(saved, robot).terms["pulley_radius"]
    assert known.vector == pytest.approx([0.03])  # fits start at what was measured
    assert known.knowledge.value == pytest.approx([0.03])
    assert known.knowledge.stderr == pytest.approx([0.0005])
    assert known.knowledge.measured.all() and not known.knowledge.fixed.any()
    changed(saved, "known = { value = 0.03, stderr = 0.0005 },", "value = 0.03, fixed = true,")
    model = load_model(saved, robot)
    assert model.terms["pulley_radius"].knowledge.fixed.all()
    assert "radius = 30 mm (fixed)" in "\n".join(model.lines())


def test_a_whole_effect_and_all_components_of_a_parameter_can_be_known(robot, tmp_path):
    path = tmp_path / "model.toml"
    path.write_text(
        '[[effect]]\nname = "stiffness"\nfixed = true\nparameters.factor = 1.4\n'
        '[[effect]]\nname = "tracker_frame"\n[effect.parameters]\nshift_x_m = 0.002\n'
        "shift_m = { value = 0.0, fixed = true }\n"
        "rotation_rad = { known = { value = 0.0, stderr = 1e-3 } }\n"
        "rotation_y_rad = { known = { value = 0.01, stderr = 1e-3 } }\n"
    )
    terms = load_model(path, robot).terms
    assert terms["stiffness"].knowledge.fixed.all()
    frame = terms["tracker_frame"]
    assert frame.vector == pytest.approx([0.002, 0, 0, 0, 0.01, 0])
    assert frame.knowledge.fixed.tolist() == [True] * 3 + [False] * 3
    assert frame.knowledge.measured.tolist() == [False] * 3 + [True] * 3


def test_what_is_known_stays_when_a_model_is_written_again(robot, saved):
    changed(saved, "value = 0.01, stderr = 0.0001,", "value = 0.03, fixed = true,")
    model = load_model(saved, robot)
    line = next(x for x in saved.read_text().splitlines() if x.startswith("radius_m"))
    moved = Fitted(model.terms["pulley_radius"], np.zeros(1), np.zeros(1, bool))
    one = fitted(robot, "stiffness", factor=1.2).term.measured(factor=(1.1, 0.02))
    new = Fitted(one, np.full(1, 0.01), np.zeros(1, bool))
    save_model(saved, with_fit(model, [moved, new], ["stiffness"], SOURCE, ERRORS))
    assert line in saved.read_text()
    back = load_model(saved, robot).terms
    assert back["pulley_radius"].knowledge.fixed.all()
    assert back["stiffness"].knowledge.value == pytest.approx([1.1])
    # and once more, as a fit would: the value moves, what was measured does not
    again = load_model(saved, robot)
    other = replace(new, term=back["stiffness"].with_vector(np.array([1.15])))
    save_model(saved, with_fit(again, [moved, other], ["stiffness"], SOURCE, ERRORS))
    last = load_model(saved, robot).terms["stiffness"]
    assert last.vector == pytest.approx([1.15]) and last.knowledge.value == pytest.approx([1.1])


def test_a_fitted_model_keeps_how_far_its_data_reach(robot, tmp_path):
    data = measured(robot)
    pulley = fitted(robot, "pulley_radius", radius_m=0.01)
    added = with_fit(new_model(robot), [pulley], ["pulley_radius"], SOURCE, ERRORS)
    save_model(tmp_path / "m.toml", renewed(added, robot, data))
    reach = load_model(tmp_path / "m.toml", robot).reach
    rests = predict(robot, data.as_commands(robot), added)
    assert reach.low == pytest.approx(rests.pose[:, :3].min(axis=0), rel=1e-3)
    assert reach.high == pytest.approx(rests.pose[:, :3].max(axis=0), rel=1e-3)
    assert reach.largest == pytest.approx(rests.tensions.max(), rel=1e-3)
    # way points, where nothing was read, are none of the data
    far = rests.pose[:, 0] > reach.high[0] - 2e-3
    position, turned = data.position.copy(), data.quat_wxyz.copy()
    position[far], turned[far] = np.nan, np.nan
    passed = replace(data, position=position, quat_wxyz=turned)
    assert renewed(added, robot, passed).reach.high[0] < reach.high[0] - 1e-3
    # a later fit's data take their place
    save_model(tmp_path / "m.toml", renewed(renewed(added, robot, data), robot, passed))
    assert load_model(tmp_path / "m.toml", robot).reach.high[0] < reach.high[0] - 1e-3


def test_a_model_to_which_nothing_was_fitted_has_no_reach_and_no_list(robot, tmp_path):
    empty = renewed(with_fit(new_model(robot), [], [], SOURCE, ERRORS), robot, measured(robot))
    save_model(tmp_path / "m.toml", empty)
    text = (tmp_path / "m.toml").read_text()
    assert "fitted_to" not in text and "effect =" not in text
    assert load_model(tmp_path / "m.toml", robot).reach is None


def together(robot):
    """Two effects with errors of 1 of which a combination is known to 1e-4."""
    both = [
        fitted(robot, "pulley_radius", error=1e-4, radius_m=0.01),
        fitted(robot, "stiffness", error=0.0123456, factor=1.2),
    ]
    sizes = np.array([1e-4, 0.0123456])
    return both, np.array([[1.0, 1.0 - 5e-9], [1.0 - 5e-9, 1.0]]) * np.outer(sizes, sizes), sizes


def known_best(model, sizes):
    """Variance of the difference of two values, each over its size."""
    opposite = np.array([1.0, -1.0]) / sizes
    return opposite @ covariance_of(model) @ opposite


def test_how_errors_go_together_is_kept_in_full(robot, tmp_path):
    both, covariance, sizes = together(robot)
    names, path = ["pulley_radius", "stiffness"], tmp_path / "m.toml"
    model = with_fit(new_model(robot), both, names, SOURCE, ERRORS, covariance)
    save_model(path, model)
    # in the order in which they act
    order = [names.index(name) for name in load_model(path, robot).terms.names]
    assert "stderr = 0.0123," in path.read_text()
    assert known_best(load_model(path, robot), sizes[order]) == pytest.approx(1e-8, rel=0.05)
    # an error that somebody wrote there counts, the full one of before no longer
    changed(path, "stderr = 0.0123,", "stderr = 0.02,")
    edited = covariance_of(load_model(path, robot))
    assert np.sqrt(np.diag(edited))[order.index(1)] == pytest.approx(0.02)


def test_a_later_fit_puts_its_errors_in_the_place_of_those_before(robot, tmp_path):
    both, covariance, _sizes = together(robot)
    names, path = ["pulley_radius", "stiffness"], tmp_path / "m.toml"
    first = with_fit(new_model(robot), both, names, SOURCE, ERRORS, covariance)
    again = with_fit(first, both, [], SOURCE, ERRORS, np.diag(np.diag(covariance)))
    save_model(path, renewed(again, robot, measured(robot)))
    assert path.read_text().count("[fit]") == 1 and "]\n\n[fitted_to]" in path.read_text()
    assert covariance_of(load_model(path, robot))[0, 1] == 0.0
    whole = calibrated(again, both, covariance, SOURCE, ERRORS)
    save_model(path, whole)
    assert "[fit]" not in path.read_text()
    assert covariance_of(load_model(path, robot))[0, 1] == pytest.approx(covariance[0, 1])
    # what the calibration was worth stays, how its errors went together does not
    after = with_fit(whole, both, [], SOURCE, ERRORS)
    save_model(path, after)
    assert "[calibration.before]" in path.read_text()
    assert covariance_of(load_model(path, robot)) is None


def test_where_a_value_is_unseen_nothing_is_told_of_what_it_may_move(robot, tmp_path):
    both, covariance, _sizes = together(robot)
    both[0] = replace(both[0], stderr=np.array([np.inf]))
    covariance[0, 0] = np.inf
    names, path = ["pulley_radius", "stiffness"], tmp_path / "m.toml"
    save_model(path, with_fit(new_model(robot), both, names, SOURCE, ERRORS, covariance))
    assert "[fit]" not in path.read_text()
    assert covariance_of(load_model(path, robot)) is None


def test_a_model_whose_effects_were_taken_out_keeps_no_covariance(robot, tmp_path):
    both, covariance, _sizes = together(robot)
    names, path = ["pulley_radius", "stiffness"], tmp_path / "m.toml"
    save_model(path, with_fit(new_model(robot), both, names, SOURCE, ERRORS, covariance))
    text = path.read_text()
    path.write_text(text[: text.index("[[effect]]")] + text[text.index("[fit]") :])
    assert covariance_of(load_model(path, robot)) is None


def test_a_calibration_that_is_no_table_is_left_alone(robot, saved):
    path = changed(saved, "format = 1\n", "format = 1\ncalibration = 3\n")
    both, _covariance, _sizes = together(robot)
    save_model(path, with_fit(load_model(path, robot), both, ["stiffness"], SOURCE, ERRORS))
    assert "calibration = 3" in path.read_text()


def test_no_effects_have_no_covariance(robot):
    model = with_fit(new_model(robot), [], [], SOURCE, ERRORS, np.zeros((0, 0)))
    assert "fit" not in model.document
