"""Exports of Motive: labels, units, quaternions with the scalar last, hidden bodies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crosscheck.importing.capture import read_motive
from seecr.errors import InputFileError

_BODY, _MARKER = 7, 3
EXPORT = "\n".join(
    [
        "Format Version,1.23,Length Units,Centimeters,Rotation Type,Quaternion,"
        "Total Exported Frames,2",
        "",
        ",Type" + _BODY * ",Rigid Body" + _MARKER * ",Marker",
        ",Name" + _BODY * ",box" + _MARKER * ",box:1",
        ",ID" + _BODY * ",1" + _MARKER * ",2",
        "," + 4 * ",Rotation" + 6 * ",Position",
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,X,Y,Z",
        "0,0.5,0,0,0.6,0.8,100,200,300,1,2,3",
        "1,0.6,,,,,,,,4,5,6",
        "",
    ]
)


def written(folder: Path, text: str = EXPORT) -> Path:
    path = folder / "take.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_bodies_and_markers_are_read_in_metres_with_the_scalar_first(tmp_path: Path) -> None:
    found = read_motive(written(tmp_path))
    assert found.t_s.tolist() == [0.5, 0.6] and found.up == "y"
    place, quat = found.bodies["box"]
    np.testing.assert_allclose(place, [[1.0, 2.0, 3.0], [np.nan] * 3])
    assert quat is not None
    np.testing.assert_allclose(quat, [[0.8, 0.0, 0.0, 0.6], [np.nan] * 4])
    assert found.markers["box:1"] == pytest.approx(np.array([[1, 2, 3], [4, 5, 6]]) * 0.01)


def test_y_up_becomes_z_up_for_positions_and_orientations(tmp_path: Path) -> None:
    place, quat = read_motive(written(tmp_path)).upright().bodies["box"]
    assert place[0] == pytest.approx([1.0, -3.0, 2.0]) and quat is not None
    # Motive's z is minus y where Z is up
    assert quat[0] == pytest.approx([0.8, 0.0, -0.6, 0.0])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("Centimeters", "Feet", "expected Length Units Meters, Centimeters or Millimeters, got 'F"),
        ("Quaternion", "XYZ", "expected Rotation Type Quaternion, got 'XYZ'"),
        (
            "Frames,2",
            "Frames,9",
            "expected 9 frames as the first line says, got 2; is the file cut",
        ),
        ("Frame,Time", "Time,Time", "has no row of labels that begins with Frame"),
        ("Time (Seconds)", "Clock", "expected a column Time"),
        ("1,0.6", "1,0.5", "are two recordings in one"),
    ],
)
def test_what_is_no_export_to_be_trusted_is_refused(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    with pytest.raises(InputFileError) as error:
        read_motive(written(tmp_path, EXPORT.replace(old, new)))
    assert said in str(error.value)
