"""Effects with values of their own for each file or run, from the command line on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import tomlkit
from called import printed, ran
from made_data import COGIRO, measured, soft_cogiro, term

import crosscheck
import seecr
from crosscheck.inference.held_out import blocks_of
from crosscheck.measurements.read import together
from crosscheck.measurements.write import write_measurements
from crosscheck.preparation.freed import laid_out
from crosscheck.preparation.prepare import prepare
from seecr.description.mjcf import load_robot
from seecr.effects import Own, Terms

pytestmark = pytest.mark.slow

ROBOT = load_robot(COGIRO)
PULLEY = {"radius_m": 0.01}
FRAMES = {
    "monday": {"shift_x_m": 0.004, "rotation_z_rad": 0.02},
    "tuesday": {"shift_x_m": -0.005, "shift_z_m": 0.3, "rotation_z_rad": -1.2},
    "wednesday": {"shift_y_m": 0.01, "rotation_x_rad": 0.3},
}


@pytest.fixture(scope="module")
def days(tmp_path_factory):
    """Three days of a robot with pulleys, its tracker set up anew for each."""
    folder = tmp_path_factory.mktemp("days")
    (folder / "robot.xml").write_text(COGIRO.read_text(encoding="utf-8"))
    for seed, (day, frame) in enumerate(FRAMES.items()):
        effects = [term(ROBOT, "pulley_radius", **PULLEY), term(ROBOT, "tracker_frame", **frame)]
        data = measured(ROBOT, effects, seed=seed, points=5)
        write_measurements(folder / f"{day}.csv", replace(data, path=folder / f"{day}.csv"))
    return folder


def run(days, *words, model="model.toml"):
    args = [str(days / w) if w.endswith((".xml", ".csv")) else w for w in words]
    return printed(*args, "--model", days / model, "--out", days / f"{words[0]}d")


@pytest.fixture(scope="module")
def added(days):
    """The model of monday and tuesday: frames of their own, then the pulleys."""
    two = ("robot.xml", "monday.csv", "tuesday.csv")
    first = run(days, "add", "tracker_frame", *two, "--per", "file")
    second = run(days, "add", "pulley_radius", *two)
    return first, second


def test_frames_of_each_file_are_added_and_stay_apart(days, added):
    assert "the residuals are noise" in added[1]
    document = tomlkit.parse((days / "model.toml").read_text(encoding="utf-8"))
    table = document["effect"][0]
    assert table["per_file"] is True and len(table["of"]) == 2
    for name, cells in table["of"].items():
        truth = FRAMES[name.split("/")[-1].removesuffix(".csv")]
        for key, cell in cells.items():
            assert cell["value"] == pytest.approx(truth.get(key, 0.0), abs=4.5 * cell["stderr"])
            assert cell["stderr"] < 5e-5
    usual = table["parameters"]["shift_z_m"]
    assert usual["value"] == pytest.approx(0.15, abs=1e-3)
    assert usual["stderr"] == pytest.approx(0.3 / np.sqrt(2.0), rel=0.01)
    pulley = document["effect"][1]["parameters"]["radius_m"]
    assert pulley["value"] == pytest.approx(0.01, abs=4 * pulley["stderr"])


def test_a_day_that_the_model_has_not_seen_is_fitted_first_and_said(days, added, unpaged):
    known = run(days, "compare", "robot.xml", "monday.csv", "--no-recording")
    assert "monday.csv as in the model" in known and "fitted to these data" not in known
    new = run(days, "compare", "robot.xml", "wednesday.csv", "--no-recording")
    assert "wednesday.csv not in the model, so fitted to these data first" in new
    assert "Model and data agree" in new
    # without its frame the day is far off
    plain = crosscheck.compare(
        ROBOT, days / "wednesday.csv", [term(ROBOT, "pulley_radius", **PULLEY)]
    )
    assert not plain.is_noise


def test_a_fixed_effect_is_not_said_to_be_fitted(days):
    held = replace(term(ROBOT, "pulley_radius", radius_m=0.03).fixed(), own=Own("file", {}))
    _terms, _fresh, notes = laid_out(
        crosscheck.load_measurements(days / "monday.csv", ROBOT), Terms([held])
    )
    assert notes[0].endswith("monday.csv not in the model, so at the fixed common values")


def test_a_model_by_hand_needs_no_values_and_a_diagnosis_goes_beside_it(days):
    (days / "by_hand.toml").write_text('[[effect]]\nname = "tracker_frame"\nper_file = true\n')
    model = seecr.load_model(days / "by_hand.toml", ROBOT)
    data = [days / "monday.csv", days / "tuesday.csv"]
    found = crosscheck.diagnose(ROBOT, data, model, only=["pulley_radius", "platform_mass"])
    assert [one.effect for one in found.missing] == ["pulley_radius"]
    assert found.verdict is crosscheck.DiagnosisVerdict.EFFECTS_FOUND


def test_without_values_of_their_own_two_set_ups_contradict_each_other(days):
    found = crosscheck.diagnose(ROBOT, [days / "monday.csv", days / "tuesday.csv"])
    assert found.verdict is crosscheck.DiagnosisVerdict.NO_VERDICT
    assert any("--per file" in line for line in found.lines())


def test_a_calibration_keeps_frames_apart_and_predicts_another_day(days, tmp_path):
    (days / "calibrated.toml").write_text('[[effect]]\nname = "tracker_frame"\nper_file = true\n')
    run(days, "calibrate", "robot.xml", "monday.csv", "tuesday.csv", "--only", "pulley_radius",
        model="calibrated.toml")  # fmt: skip
    model = seecr.load_model(days / "calibrated.toml", ROBOT)
    own = model.terms["tracker_frame"].own
    assert own is not None and len(own.values) == 2
    assert crosscheck.compare(ROBOT, days / "wednesday.csv", model).is_noise
    assert seecr.predict(ROBOT, ROBOT.reference_pose[None], model).solved.all()
    rows = [row for row in model.records() if row["of"].endswith("monday.csv")]
    assert {row["parameter"] for row in rows} == set(model.terms["tracker_frame"].layout.names)


def test_a_platform_placed_by_hand_before_each_run():
    soft = soft_cogiro()
    parts = []
    for k, offset in enumerate((0.004, -0.003, 0.001)):
        data = measured(
            soft, [term(soft, "initial_pose_error", position_x_m=offset)], seed=k, points=5
        )
        rows = data.run == data.runs[0]
        part = data.rows(rows)
        name = np.full(part.n_rows, f"run {k}")
        parts.append(replace(part, run=name, path=part.path.with_stem(f"f{k}")))
    whole = replace(together(parts), path=parts[0].path)
    found = crosscheck.add_effect(soft, whole, "initial_pose_error", per="run")
    fitted = next(one for one in found.fitted if one.term.name == "initial_pose_error")
    assert len(fitted.term.layout.parts) == 3
    for part, offset in zip(fitted.term.layout.parts, (0.004, -0.003, 0.001), strict=True):
        k = fitted.term.layout.names.index(f"{part}: position_x_m")
        assert fitted.term.vector[k] == pytest.approx(offset, abs=4 * fitted.stderr[k])
    assert found.pays and found.whiteness.is_noise


def test_a_part_of_each_file_is_left_out(days):
    data = crosscheck.load_measurements([days / "monday.csv", days / "tuesday.csv"], ROBOT)
    frame = replace(term(ROBOT, "tracker_frame"), own=Own("file", {}))
    problem = prepare(ROBOT, data, Terms([frame])).problem
    blocks = blocks_of(problem)
    assert np.array_equal(np.sum(blocks, axis=0), problem.use.astype(int))
    for rows in blocks:
        assert all(
            (rows & (data.file == k)).any() and (~rows & (data.file == k)).any() for k in (0, 1)
        )


def test_values_are_per_file_or_per_run_and_nothing_else(days):
    with pytest.raises(seecr.InputError) as error:
        crosscheck.add_effect(ROBOT, days / "monday.csv", "tracker_frame", per="day")
    assert str(error.value) == "values of an effect's own are per 'file' or 'run', got 'day'"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("per_file = true\nper_run = true\n", "is both per_file and per_run"),
        ('per_file = "yes"\n', "per_file must be true or false, got 'yes'"),
        ("per_files = true\n", "unknown per_files; expected per_file"),
        ('[effect.of."a.csv"]\nshift_x_m = 0.0\n', "neither per_file = true nor per_run = true"),
        ("per_file = true\nof = 3\n", "expected a table for each file"),
        ('per_file = true\n[effect.of."a.csv"]\nshift_x_m = 0.0\n', "shift_y_m"),
        ('per_run = true\n[effect.of."a.csv: 1"]\nshift_q_m = 0.0\n', "unknown parameter"),
    ],
)  # fmt: skip
def test_what_is_wrong_in_a_model_is_said(tmp_path, text, said):
    path = tmp_path / "m.toml"
    path.write_text(f'[[effect]]\nname = "tracker_frame"\n{text}')
    with pytest.raises(seecr.SeecrError, match=r"m\.toml") as error:
        seecr.load_model(path, ROBOT)
    assert said in str(error.value) and "\n" not in str(error.value)


def test_predictions_of_no_file_in_particular_say_so(days, added):
    said = ran(f"seecr pose {days}/robot.xml 0.4 0.25 0.15 --model {days}/model.toml", 0).output
    assert "tracker_frame has separate values for each file: the values for no particular" in said
