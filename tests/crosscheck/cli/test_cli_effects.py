"""``crosscheck effects``: the catalogue for people and for programs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from called import run
from made_data import COGIRO

from seecr.description.mjcf import load_robot
from seecr.effects import catalogue, layout_of


def test_all_effects_are_listed_with_their_place() -> None:
    result = run("effects", status=0)
    for name, effect in catalogue().items():
        (line,) = [row for row in result.stdout.splitlines() if row.split()[:1] == [name]]
        assert effect.place in line and effect.title in line


def test_one_effect_has_its_formula_and_its_size_for_a_robot() -> None:
    result = run("effects", "pulley_radius", "--robot", COGIRO, status=0)
    assert "r (pi - psi)" in result.stdout
    layout = layout_of(catalogue()["pulley_radius"], load_robot(COGIRO))
    assert f"expected size {1e3 * layout.scale[0]:.3g} mm" in result.stdout
    assert f", at most {1e3 * layout.upper[0]:.4g} mm" in result.stdout
    assert "check by hand: measure a sheave with a caliper" in result.stdout


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("drum_gain", "gain [no unit], one per cable"),
        ("exit_point_error", ", x y z per cable"),
        ("stiffness", "factor [no unit]: absent at 1, expected size 0.3\n"),
        ("pulley_radius", "radius [mm]: absent at 0, expected size 2 % of the mean cable length\n"),
        ("pulley_radius",
         "expected sizes depend on the robot: --robot ROBOT.xml gives their numbers"),
        ("creep", "time [s]: modifies the others, starts at 100"),
        ("frame_compliance", "sideways [mm/N]"),
    ],
)  # fmt: skip
def test_parameters_have_units_and_sizes_for_people(name: str, said: str) -> None:
    """Also without a robot: a size is a number, or a formula of it."""
    assert said in run("effects", name).stdout


@pytest.mark.parametrize("name", list(catalogue()))
def test_every_effect_can_be_described(name: str) -> None:
    result = run("effects", name, status=0)
    assert "{" not in result.stdout
    assert name != "gravity_tilt" or "depend" not in result.stdout
    for row in json.loads(run("effects", name, "--json").stdout)["parameters"]:
        words = row["plausible_size_words"]
        assert words != "depends on the robot"  # each built-in one has its formula
        assert (row["plausible_size"] is None) == ("%" in words or " / " in words)


def test_for_programs() -> None:
    every = json.loads(run("effects", "--json").stdout)["effects"]
    assert [row["effect"] for row in every] == list(catalogue())
    named = json.loads(run("effects", "drum_gain", "--robot", "demobot_cogiro", "--json").stdout)
    assert list(named["made"]["sha256"]) == [COGIRO.name]
    one = json.loads(run("effects", "drum_gain", "--robot", COGIRO, "--json").stdout)
    assert len(one["parameters"]) == load_robot(COGIRO).n_cables
    assert {row["plausible_size_words"] for row in one["parameters"]} == {"0.005"}
    assert not one["own"]


def test_the_catalogue_is_kept_in_a_folder(tmp_path: Path) -> None:
    shown = run("effects", "--json", "--out", tmp_path / "out").stdout
    assert json.loads((tmp_path / "out/effects.json").read_text()) == json.loads(shown)
    one = run("effects", "stiffness", "--out", tmp_path / "out")
    assert one.exit_code == 0 and "stiffness" in one.stdout
    assert json.loads((tmp_path / "out/effects.json").read_text())["effect"] == "stiffness"
    (tmp_path / "file").write_text("")
    refused = run("effects", "--out", tmp_path / "file")
    assert refused.exit_code == 2 and f"--out {tmp_path}/file: cannot write there" in refused.stderr


def test_an_unknown_name_names_the_nearest() -> None:
    result = run("effects", "pully_radius", status=2)
    assert "pulley_radius" in result.stderr and result.stderr.count("\n") == 1
