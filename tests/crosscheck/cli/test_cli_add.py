"""``crosscheck add``: the error falls, the model grows, and what does not pay is not added."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from called import refused, run
from made_data import SIGMA, case, measured, soft_cogiro, term

from crosscheck.add import add_effect
from crosscheck.errors import CrosscheckError
from crosscheck.measurements.read import load_measurements
from crosscheck.measurements.write import write_measurements
from seecr.description.mjcf import load_robot
from seecr.prediction.model import load_model

pytestmark = pytest.mark.slow

HIDDEN = {"pulley_radius": {"radius_m": 0.01}, "centre_of_mass": {"shift_x_m": 0.004}}


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """Pulleys and a shifted centre of mass, which the model does not know."""
    return case(tmp_path_factory.mktemp("both"), HIDDEN)


def add(effect, files, model, *more):
    return run("add", effect, *files, "--model", model, *more)


def test_added_one_after_the_other_the_error_falls_to_the_noise(both, tmp_path, unpaged):
    model, out = tmp_path / "model.toml", tmp_path / "out"
    gate = ("--max-position", "0.04mm", "--max-orientation", "0.025deg", "--no-recording")
    assert run("compare", *both, *gate, "--out", out).exit_code == 1
    said = json.loads(add("pulley_radius", both, model, "--json", "--out", out).stdout)
    assert said == json.loads((out / "add.json").read_text()) and said["written"] is True
    assert set(said["made"]["sha256"]) == {"robot.xml", "measured.csv", "measured.toml"}
    radius = said["effects"]["pulley_radius"]["radius_m"]
    assert radius["unit"] == "m" and radius["at_bound"] is False
    assert said["held_out"]["position_rms_m"] < said["held_out_before"]["position_rms_m"]
    first = add("pulley_radius", both, tmp_path / "again.toml")
    assert first.exit_code == 0
    assert "before" in first.stdout and "on test runs" in first.stdout
    assert "crosscheck diagnose" in first.stdout  # something is still missing
    compared = ("compare", *both, "--model", model, *gate, "--out", out)
    assert run(*compared).exit_code == 1
    second = add("centre_of_mass", both, model)
    assert second.exit_code == 0 and "the residuals are noise" in second.stdout
    assert run(*compared).exit_code == 0
    robot = load_robot(both[0])
    found = load_model(model, robot)
    assert found.names == ("pulley_radius", "centre_of_mass")
    for one in found.terms:
        truth = np.array([HIDDEN[one.name].get(k, 0.0) for k in one.layout.names])
        assert np.all(np.abs(one.vector - truth) < 4.0 * found.stderr[one.name])
    table = found.document["effect"][1]
    assert table["before"]["orientation_rms_rad"] > 5 * SIGMA.orientation_rad
    assert table["after"]["orientation_rms_rad"] < 1.2 * SIGMA.orientation_rad
    assert table["held_out"]["position_rms_m"] < 1.2 * SIGMA.position_m
    assert table["provenance"]["data"] == "measured.csv"
    assert found.document["effect"][0]["refitted"]["by"] == "crosscheck add centre_of_mass"


def test_an_effect_that_does_not_pay_is_not_written_unless_forced(both, tmp_path):
    model = tmp_path / "model.toml"
    add("pulley_radius", both, model)
    add("centre_of_mass", both, model)
    before = model.read_text()
    result = add("tracker_scale", both, model)
    assert result.exit_code == 1 and model.read_text() == before
    assert "it is not worth adding; --force adds it anyway" in result.stdout
    result = add("tracker_scale", both, model, "--force")
    assert result.exit_code == 0 and "tracker_scale" in model.read_text()
    assert "it is not worth adding; added because of --force\n" in result.stdout


def test_what_is_there_already_is_only_fitted_again_when_asked(both, tmp_path):
    model = tmp_path / "model.toml"
    assert "has no pulley_radius to fit again (it has none)" in refused(
        "add", "pulley_radius", *both, "--model", model, "--refit"
    )
    assert not model.exists()
    add("pulley_radius", both, model)
    assert "already has pulley_radius; --refit fits it again" in refused(
        "add", "pulley_radius", *both, "--model", model
    )
    # somebody changed it by hand
    text = model.read_text()
    wrong = re.sub(r"radius_m = { value = [0-9.e-]+", "radius_m = { value = 0.013", text)
    assert wrong != text
    model.write_text(wrong)
    assert add("pulley_radius", both, model, "--refit").exit_code == 0
    again = load_model(model, load_robot(both[0]))
    assert again.names == ("pulley_radius",)
    assert again.terms["pulley_radius"].vector[0] == pytest.approx(0.01, abs=5e-4)
    # what is fixed is never fitted, so that there is nothing to weigh
    name = 'name = "pulley_radius"'
    model.write_text(model.read_text().replace(name, f"{name}\nfixed = true"))
    assert "pulley_radius is fixed and never fitted" in refused(
        "add", "pulley_radius", *both, "--model", model, "--refit"
    )


@pytest.mark.parametrize(
    ("effect", "name", "said"),
    [
        ("exit_point_error", "few.csv",
         "few.csv: exit_point_error cannot be fitted to these data: has 24 parameters, but the "
         "data have only 10 rows"),
        ("thermal_expansion", "measured.csv",
         "thermal_expansion cannot be fitted to these data: needs the temperature, column "
         "temperature_C"),
        ("tension_scale", "measured.csv",
         "tension_scale cannot be fitted to these data: needs measured tensions"),
        ("creep", "timeless.csv", "needs the time of each row, column t_s"),
        ("stiffness", "still.csv", "all commands are the same"),
        ("pulley_radus", "measured.csv",
         "no effect 'pulley_radus'; known, nearest first: pulley_radius, "),
    ],
)  # fmt: skip
def test_what_the_data_cannot_carry_is_refused(both, tmp_path, effect, name, said):
    data = measured(load_robot(both[0]))
    write_measurements(tmp_path / "measured.csv", data)
    write_measurements(tmp_path / "few.csv", data.rows(slice(0, 10)))
    write_measurements(tmp_path / "timeless.csv", replace(data, t_s=None))
    write_measurements(tmp_path / "still.csv", data.rows(np.zeros(30, dtype=int)))
    words = ("add", effect, both[0], tmp_path / name, "--model", tmp_path / "m.toml")
    assert said in refused(*words)
    assert not (tmp_path / "m.toml").exists()


def test_a_single_run_is_cut_into_blocks_of_time_and_said_so(tmp_path):
    xml, data = case(tmp_path, {"pulley_radius": {"radius_m": 0.01}})
    robot = load_robot(xml)
    rows = load_measurements(data, robot)
    write_measurements(data, replace(rows, run=np.full(rows.n_rows, "one")))
    result = add("pulley_radius", (xml, data), tmp_path / "m.toml")
    assert result.exit_code == 0
    assert "a single run: cross-validation leaves out 5 blocks of time" in result.stdout


def test_all_slack_rows_end_3(tmp_path):
    robot = soft_cogiro()
    loose = replace(robot, gravity=np.zeros(3), rest_lengths=robot.rest_lengths + 1.0)
    with pytest.raises(CrosscheckError, match="equilibrium") as error:
        add_effect(loose, measured(robot), "stiffness")
    assert error.value.exit_status == 3


def test_values_on_a_bound_are_warned_of():
    robot = soft_cogiro()
    # pulleys of a negative radius, if there were such, turn these errors round
    plain = measured(robot)
    bent = measured(robot, [term(robot, "pulley_radius", radius_m=0.002)])
    mirrored = replace(plain, position=2 * plain.position - bent.position)
    found = add_effect(robot, mirrored, "pulley_radius")
    assert found.own.at_bound[0] and not found.pays
    assert any("radius_m stopped at a bound" in w for w in found.warnings)


def test_effects_that_go_together_are_named():
    robot = soft_cogiro()
    data = measured(robot, [term(robot, "stiffness", factor=1.4)])
    found = add_effect(robot, data, "platform_mass", [term(robot, "stiffness", factor=1.4)])
    assert not found.pays  # mass and stiffness move a robot alike
    assert any("hardly separate them" in w or "not determined" in w for w in found.warnings)
