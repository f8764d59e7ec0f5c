"""Paths and loaded objects give the same; results print, show themselves, and give data frames."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
from made_data import measured, term
from made_diagnoses import SIGMA, SLOW

import crosscheck
import seecr
from crosscheck.suite.cases import Case, select, shipped_cases
from seecr.result import Result

pytestmark = pytest.mark.slow

ROBOT = seecr.model_path("planar_vertical")


@cache
def data_file() -> Path:
    """Poses and tensions of a planar robot with pulleys of 10 mm, as a CSV."""
    robot = seecr.load_robot(ROBOT)
    terms = [term(robot, "pulley_radius", radius_m=0.01)]
    path = Path(mkdtemp()) / "measured.csv"
    data = measured(robot, terms, points=6, sigma=SIGMA, tensions=True)
    crosscheck.write_measurements(path, data)
    return path


@cache
def found() -> crosscheck.Diagnosis:
    return crosscheck.diagnose(ROBOT, data_file(), exclude=SLOW)


@cache
def case() -> Case:
    return select(shipped_cases(), ["planar-horizontal-*"])[0]


@cache
def result_of(name: str) -> Result:
    """One result of each function."""
    functions = {
        "Measurements": lambda: crosscheck.load_measurements(data_file(), ROBOT),
        "Comparison": lambda: crosscheck.compare(str(ROBOT), str(data_file())),
        "Diagnosis": found,
        "Addition": lambda: crosscheck.add_effect(ROBOT, data_file(), "pulley_radius"),
        "Calibrated": lambda: crosscheck.calibrate(ROBOT, data_file(), exclude=SLOW),
        "Plan": lambda: crosscheck.make_plan(ROBOT, data_file()),
        "Twin": lambda: crosscheck.make_twin(ROBOT, 1, points=4),
        "CaseResult": lambda: crosscheck.run_suite([case()]).results[0],
        "Run": lambda: crosscheck.run_suite([case()]),
    }
    made: Result = functions[name]()
    return made


NAMES = [
    "Measurements", "Comparison", "Diagnosis", "Addition",
    pytest.param("Calibrated", marks=pytest.mark.slow), "Plan", "Twin", "CaseResult", "Run",
]  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_a_result_shows_itself(name: str) -> None:
    result = result_of(name)
    assert type(result) is getattr(crosscheck, name)
    lines = str(result).split("\n")
    assert 1 <= len(lines) <= 60 and all(0 < len(line) < 400 for line in lines)
    assert repr(result) == str(result)
    page = result._repr_html_()
    frame = result.to_frame()
    assert frame.num_rows == len(result.records()) > 0
    assert all(f"<th>{head}</th>" in page for head in frame.column_names)


def test_objects_give_what_paths_give() -> None:
    robot = seecr.load_robot(ROBOT)
    data = crosscheck.load_measurements(data_file(), robot)
    assert data.to_frame().equals(result_of("Measurements").to_frame())
    again = crosscheck.compare(robot, data)
    assert again.to_frame().equals(result_of("Comparison").to_frame())
    plan = crosscheck.make_plan(robot, crosscheck.load_commands(data_file(), robot))
    assert plan.to_frame().equals(result_of("Plan").to_frame())
    twin = crosscheck.make_twin(robot, 1, points=4)
    assert twin.to_frame().equals(result_of("Twin").to_frame())
    run = crosscheck.run_suite("planar-horizontal-*").to_frame()
    assert run.slice(0, len(case())).equals(result_of("Run").to_frame())


def test_a_plan_is_of_poses_too() -> None:
    data = crosscheck.load_measurements(data_file(), ROBOT)
    one_run = replace(data, run=np.full(data.n_rows, "all"), t_s=None)
    wanted = crosscheck.make_plan(ROBOT, one_run, data.sigma).to_frame()
    assert data.command_pose is not None
    assert crosscheck.make_plan(ROBOT, data.command_pose, data.sigma).to_frame().equals(wanted)
    with pytest.raises(seecr.InputError, match=r"^poses must be \(n, 7\)"):
        crosscheck.make_plan(ROBOT, [[1.0, 2.0]])


def test_what_was_found_is_the_next_model() -> None:
    """As terms, as a model and as a file; what is left is noise in each."""
    robot = seecr.load_robot(ROBOT)
    assert [t.name for t in found().terms] == ["pulley_radius"]
    left = crosscheck.compare(ROBOT, data_file(), found().terms)
    assert left.is_noise and not crosscheck.compare(ROBOT, data_file()).is_noise
    value = float(found().terms["pulley_radius"].vector[0])
    path = data_file().with_name("model.toml")
    path.write_text(
        f'format = 1\n[[effect]]\nname = "pulley_radius"\nparameters = {{radius_m = {value!r}}}\n'
    )
    for model in (path, str(path), seecr.load_model(path, robot)):
        assert crosscheck.compare(ROBOT, data_file(), model).rms == left.rms
    assert crosscheck.diagnose(ROBOT, data_file(), path, exclude=SLOW).missing == ()


def test_what_was_fitted_is_a_model_to_keep(tmp_path: Path) -> None:
    calibration = result_of("Calibrated")
    addition = crosscheck.add_effect(ROBOT, data_file(), "stiffness", found().terms)
    assert isinstance(calibration, crosscheck.Calibrated)
    assert addition.model.names == ("stiffness", "pulley_radius")
    for number, result in enumerate((calibration, addition)):
        path = tmp_path / "models" / f"{number}.toml"
        crosscheck.save_model(path, result.model)
        again = seecr.load_model(path, ROBOT)
        assert np.allclose(again.terms.vector, result.terms.vector) and again.notes == ()
        left = crosscheck.compare(ROBOT, data_file(), result.model).rms
        assert crosscheck.compare(ROBOT, data_file(), path).rms == pytest.approx(left, rel=1e-6)
        assert data_file().name in path.read_text()
    words = r"^expected a model, .* got Calibrated; its \.model is one$"
    with pytest.raises(seecr.InputError, match=words):
        crosscheck.save_model(tmp_path / "m.toml", calibration)  # type: ignore[arg-type]


def test_a_plan_is_written_as_commands(tmp_path: Path) -> None:
    plan = result_of("Plan")
    assert isinstance(plan, crosscheck.Plan)
    names = crosscheck.write_plan(plan, tmp_path / "plan")
    assert sorted(names) == sorted(p.name for p in (tmp_path / "plan").glob("*.csv"))
    commands = crosscheck.load_commands(tmp_path / "plan" / "poses.csv", ROBOT)
    assert commands.n_rows == plan.planned.problem.data.n_rows and not commands.has_position


def test_a_diagnosis_reads_like_one() -> None:
    text = str(found())
    assert text.startswith("In these data ") and "\neffects_found: " in text
    assert "\n+ pulley_radius: " in text and "(on test runs " in text
    assert "\nnoise alone: " in text and "    check: " in text
    (row,) = found().to_frame().to_pylist()
    assert row["effect"] == "pulley_radius" and row["parameter"] == "radius_m"
    assert row["value"] == pytest.approx(0.01, abs=4 * row["stderr"])


def test_frames_hold_what_the_csv_holds() -> None:
    data = crosscheck.load_measurements(data_file(), ROBOT)
    frame = data.to_frame()
    header = data_file().read_text().split("\n", 1)[0].split(",")
    assert set(header) <= set(frame.column_names)
    assert np.array_equal(frame["meas_x_m"].to_numpy(), data.position[:, 0])
    assert np.array_equal(frame["tension_2_N"].to_numpy(), data.tensions[:, 1])


def test_a_run_tells_what_mujoco_leaves_out() -> None:
    run = result_of("Run")
    assert isinstance(run, crosscheck.Run) and "note: " not in str(run)
    odd = replace(run, results=[replace(run.results[0], ignored=("contacts",))])
    assert str(odd) == f"{run}\nnote: {odd.notes[0]}" and "contacts" in odd.notes[0]
