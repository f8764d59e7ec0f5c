"""Measurements come back from files as they were written, CSV and Parquet."""

from __future__ import annotations

import builtins
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.read import load_measurements
from crosscheck.measurements.write import write_measurements
from seecr.commands import Loads
from seecr.errors import InputFileError, MissingPackageError

PLAIN = Measurements(
    path=Path("a.csv"),
    n_cables=3,
    run=np.array(["a", "b"]),
    command_lengths=np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
    position=np.array([[0.1, np.nan, np.nan], [np.nan] * 3]),
    tensions=np.array([[np.nan, 7.0, np.nan], [np.nan, 8.0, np.nan]]),
)


def columns(**changes: object) -> dict[str, list]:
    return dict(replace(PLAIN, **changes).columns())  # type: ignore[arg-type]


def test_only_what_somebody_read_has_a_column_and_gaps_are_none() -> None:
    assert columns() == {
        "run": ["a", "b"],
        **{f"length_{i}_m": [float(i), 3.0 + i] for i in (1, 2, 3)},
        "meas_x_m": [0.1, None],
        "tension_2_N": [7.0, 8.0],
    }


def test_a_centre_of_no_payload_and_forces_of_zero_are_nothing() -> None:
    centre, wrench = np.array([0.1, 0.2, 0.3]), np.zeros((2, 6))
    wrench[1, 4] = 2.0
    there = columns(loads=Loads.of(2, centre=centre, wrench=wrench))
    assert {key: there[key] for key in there if key not in columns()} == {"moment_y_Nm": [0.0, 2.0]}
    hung = columns(loads=Loads.of(2, mass=np.array([0.0, 1.0]), centre=centre))
    assert hung["payload_kg"] == [0.0, 1.0] and hung["payload_z_m"] == [0.3, 0.3]
    own = columns(loads=Loads.of(2, mass=np.array(1.0)))
    assert "payload_kg" in own and "payload_x_m" not in own


def everything(path: Path) -> Measurements:
    rng = np.random.default_rng(5)
    quat = rng.normal(size=(6, 4))
    tensions = np.full((6, 4), np.nan)
    tensions[:, 1] = rng.uniform(0, 9, 6)
    position = rng.normal(size=(6, 3))
    position[2] = np.nan
    loads = Loads(
        np.repeat([0.5, 0.25, 0.0], 2), np.where(position > 0.0, [[0.1, 0.2, 0.3]], 0.4),
        np.outer(np.arange(6.0), [1, 0, 2, 0, 0, 3]),
    )  # fmt: skip
    loads.centre[1] = np.nan
    wanted = np.concatenate([position + 0.01, np.tile([0.0, 0.6, 0.8, 0.0], (6, 1))], axis=1)
    return Measurements(
        path=path,
        n_cables=4,
        run=np.array(["#a"] * 3 + ['b, "c"'] * 3),
        t_s=np.arange(6.0),
        command_lengths=rng.uniform(1, 2, (6, 4)),
        wanted=wanted,
        position=position,
        quat_wxyz=quat / np.linalg.norm(quat, axis=1, keepdims=True),
        tensions=tensions,
        temperature_C=np.linspace(-5, 25, 6),
        told=True,
        loads=loads,
        stands=np.ones(6, dtype=bool),
        sigma=Sigma(position_m=3e-5, length_m=0.1 + 0.2),
        sigma_source="dwell_scatter",
    )


def test_round_trip_through_a_file(tmp_path, robot):
    made = everything(tmp_path / "measured.csv")
    write_measurements(made.path, made)
    back = load_measurements(made.path, robot)
    compared = ("t_s", "command_lengths", "wanted", "position", "quat_wxyz", "tensions")
    for name in (*compared, "temperature_C"):
        np.testing.assert_allclose(getattr(back, name), getattr(made, name), rtol=1e-8, atol=1e-9)
    for name in ("mass", "centre", "wrench"):
        np.testing.assert_allclose(getattr(back.loads, name), getattr(made.loads, name))
    assert back.run.tolist() == made.run.tolist() and back.told and back.stands.all()
    assert back.sigma == made.sigma and back.sigma_source == "dwell_scatter"
    assert back.tension_mask.tolist() == [False, True, False, False]
    assert back.command_pose is None and back.line.tolist() == [2, 3, 4, 5, 6, 7]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["measured.csv", "measured.toml"]


def test_partial_angles_round_trip(tmp_path, robot):
    pose = np.tile([0.1, 0, 0, 1.0, 0, 0, 0], (2, 1))
    angles = np.array([[0.1, np.nan, -0.0], [0.25, np.nan, np.nan]])
    made = Measurements(
        tmp_path / "m.csv", 4, np.array(["a", "a"]), command_pose=pose, angles_rad=angles
    )
    write_measurements(made.path, made)
    header = "run,cmd_x_m,cmd_y_m,cmd_z_m,cmd_qw,cmd_qx,cmd_qy,cmd_qz,meas_rx_rad,meas_rz_rad"
    rows = "a,0.1,0,0,1,0,0,0,0.1,0\na,0.1,0,0,1,0,0,0,0.25,\n"
    assert made.path.read_text() == f"{header}\n{rows}"
    assert np.array_equal(load_measurements(made.path, robot).angles_rad, angles, equal_nan=True)


def test_writing_again_leaves_no_old_sigma(tmp_path, robot):
    made = everything(tmp_path / "measured.csv")
    write_measurements(made.path, made)
    pose = np.tile([0.1, 0, 0, 1.0, 0, 0, 0], (1, 1))
    plain = Measurements(made.path, 4, np.array(["a"]), command_pose=pose, position=pose[:, :3])
    write_measurements(made.path, plain)
    assert load_measurements(made.path, robot).sigma == Sigma()


def test_unwritable_folder_leaves_nothing(tmp_path):
    made = everything(tmp_path / "nowhere" / "measured.csv")
    with pytest.raises(InputFileError, match=r"measured.csv: cannot be written: No such file"):
        write_measurements(made.path, made)
    (tmp_path / "measured.csv").mkdir()
    with pytest.raises(InputFileError, match="cannot be written: Is a directory"):
        write_measurements(tmp_path / "measured.csv", made)
    assert [p.name for p in tmp_path.iterdir()] == ["measured.csv"]


def test_half_of_the_commands_or_wrong_shapes_are_refused_in_code(tmp_path):
    with pytest.raises(ValueError, match="exactly one of command_pose and command_lengths"):
        Measurements(tmp_path, 4, np.array(["a"]))
    with pytest.raises(ValueError, match=r"command_lengths must be \(1, 4\), got \(1, 3\)"):
        Measurements(tmp_path, 4, np.array(["a"]), command_lengths=np.ones((1, 3)))


def parquet_file(path: Path, columns: dict[str, list]) -> Path:
    pyarrow = pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    from pyarrow import parquet

    parquet.write_table(pyarrow.table(columns), path)
    return path


def test_parquet_has_the_same_columns(tmp_path, robot):
    columns = {
        "run": ["a", "a"],
        "cmd_x_mm": [1, 2],
        "cmd_y_m": [0.1, 0.2],
        "cmd_z_m": [0.1, 0.3],
        "meas_x_m": [None, 0.1 + 0.2],
        "remark": ["x", None],
    }
    data = load_measurements(parquet_file(tmp_path / "measured.parquet", columns), robot)
    assert data.command_pose[:, 0].tolist() == [0.001, 0.002]
    assert np.isnan(data.position[0, 0]) and data.position[1, 0] == 0.1 + 0.2
    assert data.unused_columns == ("remark",)
    assert data.line.tolist() == [1, 2]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (
            {"meas_x_m": [0.0, float("inf")]},
            "measured.parquet: row 2, column meas_x_m: .*got 'inf'",
        ),
        ({"cmd_y_m": [None, 1.0]}, "row 1, column cmd_y_m: .*got an empty cell"),
        ({"cmd_y_in": [1.0, 1.0]}, "measured.parquet: column cmd_y_in: unknown unit 'in'"),
        ({"meas_x_m": ["1.5", "b"]}, "row 2, column meas_x_m: .*got 'b'"),
        ({"t_s": [2.0, 1.0]}, "row 2, column t_s: rows out of time order"),
        (
            {k: [] for k in ("cmd_x_m", "cmd_y_m", "cmd_z_m", "meas_x_m")},
            "has columns but no rows; expected one row per resting pose",
        ),
    ],
)
def test_mistakes_in_parquet(tmp_path, robot, change, expected):
    columns = {k: [0.5, 1.5] for k in ("cmd_x_m", "cmd_y_m", "cmd_z_m", "meas_x_m")} | change
    path = parquet_file(tmp_path / "measured.parquet", columns)
    with pytest.raises(InputFileError, match=expected):
        load_measurements(path, robot)


@pytest.mark.benchmark
def test_hundred_thousand_rows_load_in_seconds(tmp_path, robot):
    n = 100_000
    rng = np.random.default_rng(1)
    pose = np.concatenate([rng.normal(size=(n, 3)), np.tile([1.0, 0, 0, 0], (n, 1))], axis=1)
    made = Measurements(
        path=tmp_path / "big.csv",
        n_cables=4,
        run=np.repeat([f"run {i}" for i in range(100)], n // 100),
        t_s=np.arange(n, dtype=float),
        command_pose=pose,
        position=pose[:, :3],
        quat_wxyz=pose[:, 3:],
    )
    write_measurements(made.path, made)
    began = time.process_time()
    assert load_measurements(made.path, robot).n_rows == n
    assert time.process_time() - began < 5.0


@pytest.mark.parametrize(
    ("raised", "expected", "words"),
    [
        (ModuleNotFoundError("no", name="pyarrow"), MissingPackageError, "which needs pyarrow"),
        (ModuleNotFoundError("no dateutil", name="dateutil"), ModuleNotFoundError, "no dateutil"),
        (ImportError("undefined symbol", name="pyarrow.lib"), ImportError, "undefined symbol"),
    ],
)
def test_a_broken_pyarrow_is_not_called_missing(
    tmp_path, robot, monkeypatch, raised, expected, words
):
    real = builtins.__import__

    def fail(name, *others, **more):
        if name == "pyarrow":
            raise raised
        return real(name, *others, **more)

    (tmp_path / "measured.parquet").write_bytes(b"PAR1")
    monkeypatch.setattr(builtins, "__import__", fail)
    with pytest.raises(expected, match=words):
        load_measurements(tmp_path / "measured.parquet", robot)
