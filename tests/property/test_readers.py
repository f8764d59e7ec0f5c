"""Whatever happens to a file, its reader gives finite numbers or a sentence of the typed error."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import made_recordings
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_data import soft_cogiro
from measured_csv import FREE, mjcf
from spoiled import spoiled

from crosscheck import load_limits, load_measurements, load_thresholds, save_model, unseal
from crosscheck.importing.capture import read_motive, read_vicon
from crosscheck.importing.poses import read_poses
from crosscheck.twin.hidden import Answer, Moves, seal
from seecr import SeecrError, load_model, load_robot, new_model
from seecr.columns.commands import read_commands

XML = mjcf(FREE, 'pos="0 0.05 0" quat="0.8 0 0 0.6"')
CSV = """run,t_s,cmd_x_mm,cmd_y_mm,cmd_z_mm,meas_x_m,meas_y_m,meas_z_m,tension_1_N,payload_kg
out,0,0,50,100,0.001,0.05,0.098,5.2,0
out,12,10,50,100,,,,,0
out,24,20,50,100,0.021,0.051,0.0977,nan,0.2
back,30,10,55.5,100,0.012,0.0553,0.0979,5.1,0.2
"""
TOML = """lengths = "absolute"
start = "first_row"
free = ["tracker_frame"]
[sigma]
position_m = "0.03mm"
tension_N = 0.05
source = "stated"
"""
LIMITS = 'max_position = "0.5mm"\nmax_tension_worst = "3N"\nmax_orientation = "0.1deg"\n'
THRESHOLDS = """[polished]
position_m = 1e-8
tension_N = 1e-6
[findings]
branches = 0
free_to_move = ["a 14", "b 8*"]
free_elsewhere = 0.1
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("spoiled")


@pytest.fixture(scope="module")
def robot(folder: Path):
    (folder / "small.xml").write_text(XML)
    return load_robot(folder / "small.xml")


def numbers_of(found: Any) -> list[float]:
    """All numbers in a result, whatever it is made of; NaN stands for what was not read."""
    if isinstance(found, float):
        return [found]
    if isinstance(found, np.ndarray) and found.dtype.kind == "f":
        return [float(x) for x in found.ravel()]
    if isinstance(found, dict):
        return [x for one in found.values() for x in numbers_of(one)]
    if isinstance(found, list | tuple):
        return [x for one in found for x in numbers_of(one)]
    if is_dataclass(found):
        return numbers_of([getattr(found, item.name) for item in fields(found)])
    return []


def read_or_refused(read: Callable[[Path], Any], path: Path, content: bytes) -> bool:
    """Whether a file is read; if not, the error is typed and tells the file in printable words."""
    path.write_bytes(content)
    try:
        found = read(path)
    except SeecrError as error:
        told = str(error)
        assert path.name in told and told.replace("\n", "").isprintable(), told
        assert len(told) < 4000, "an error is a few lines"
        return False
    assert not np.isinf(numbers_of(found)).any()
    return True


def test_measurements(folder: Path, robot: Any) -> None:
    for content in spoiled(CSV.encode()):
        read_or_refused(lambda path: load_measurements(path, robot), folder / "m.csv", content)
        read_or_refused(lambda path: read_commands(path, robot), folder / "c.csv", content)


def test_toml_of_measurements(folder: Path, robot: Any) -> None:
    csv = folder / "beside.csv"
    csv.write_text(CSV)
    for content in spoiled(TOML.encode()):
        read_or_refused(lambda _: load_measurements(csv, robot), folder / "beside.toml", content)


def test_limits(folder: Path) -> None:
    for content in spoiled(LIMITS.encode()):
        read_or_refused(load_limits, folder / "limits.toml", content)


def test_thresholds(folder: Path) -> None:
    for content in spoiled(THRESHOLDS.encode()):
        read_or_refused(load_thresholds, folder / "thresholds.toml", content)


def test_robots(folder: Path) -> None:
    for content in spoiled(XML.encode()):
        read_or_refused(load_robot, folder / "robot.xml", content)


EFFECTS = """
[[effect]]
name = "stiffness"
[effect.parameters]
factor = {value = 1.02, stderr = 0.003}

[[effect]]
name = "cable_length_offset"
[effect.parameters]
offset_1_m = 0.001
offset_2_m = {value = 0.002, stderr = 1e-5, fixed = true}
offset_3_m = {value = 0.0, known = {value = 0.001, stderr = 1e-4}}
offset_4_m = 0.0
"""


@pytest.fixture(scope="module")
def model(folder: Path, robot: Any) -> bytes:
    save_model(folder / "plain.toml", new_model(robot))
    text = (folder / "plain.toml").read_text() + EFFECTS
    (folder / "plain.toml").write_text(text)
    load_model(folder / "plain.toml", robot)
    return text.encode()


def test_models(folder: Path, robot: Any, model: bytes) -> None:
    for content in spoiled(model):
        read_or_refused(lambda path: load_model(path, robot), folder / "model.toml", content)


ENDS = st.sampled_from(["\r\n", "\n"])


@given(end=ENDS, mark=st.booleans(), order=st.permutations(range(10)), sep=st.sampled_from(",;\t"),
       blanks=st.integers(0, 2), quoted=st.booleans(), comment=st.booleans())  # fmt: skip
def test_spelling_changes_no_reading(folder: Path, robot: Any, end: str, mark: bool,
                                     order: list[int], sep: str, blanks: int, quoted: bool,
                                     comment: bool) -> None:  # fmt: skip
    """Ends of lines, marks of bytes, order of columns, separators, blanks, quotes, comments."""
    rows = [line.split(",") for line in CSV.splitlines()]
    cells = [[" " * blanks + (f'"{row[k]}"' if quoted else row[k]) for k in order] for row in rows]
    if sep == "\t":
        cells = [[cell.strip(" ") for cell in row] for row in cells]
    lines = [*(["# made by hand"] if comment else []), *(sep.join(row) for row in cells)]
    text = ("\ufeff" if mark else "") + end.join(lines) + end
    plain, other = folder / "plain.csv", folder / "other.csv"
    plain.write_text(CSV)
    other.write_bytes(text.encode())
    ours, theirs = (load_measurements(path, robot) for path in (plain, other))
    for name in ("command_pose", "position", "tensions", "t_s"):
        assert getattr(theirs, name).tobytes() == getattr(ours, name).tobytes()
    assert theirs.loads.mass.tolist() == ours.loads.mass.tolist()


ANSWER = Answer("r", 4, {"stiffness": {"factor": 1.1}}, {"stiffness": Moves(3.0, 1.5)},
                Moves(3.0, 1.5), {"position_m": 1e-5}, 144, "MuJoCo")  # fmt: skip
SEALED = seal(ANSWER)
FIRST, _, BODY = SEALED.partition("\n")


def test_sealed_answers(folder: Path) -> None:
    for content in spoiled(SEALED.encode()):
        read_or_refused(unseal, folder / "answer.sealed", content)


def test_what_is_sealed(folder: Path) -> None:
    for content in spoiled(zlib.decompress(base64.b64decode(BODY))):
        packed = base64.b64encode(zlib.compress(content))
        read_or_refused(unseal, folder / "answer.sealed", FIRST.encode() + b"\n" + packed + b"\n")


@pytest.fixture(scope="module")
def logs(folder: Path) -> dict[str, bytes]:
    """Recordings of a few dozen rows, their heads whole."""
    made = made_recordings.recording(soft_cogiro())
    write = {"motive": made_recordings.motive_csv, "vicon": made_recordings.vicon_csv,
             "poses": made_recordings.poses_csv}  # fmt: skip
    out = {}
    for name, one in write.items():
        lines = one(folder / f"{name}.csv", made).read_bytes().split(b"\n")
        out[name] = b"\n".join([*lines[:40], b""])
    return out


READ = {"motive": read_motive, "vicon": lambda path: read_vicon(path, "vector"),
        "poses": read_poses}  # fmt: skip


@pytest.mark.parametrize("form", READ)
def test_logs_of_motion_capture(folder: Path, logs: dict[str, bytes], form: str) -> None:
    for content in spoiled(logs[form]):
        read_or_refused(READ[form], folder / "log.csv", content)
