"""Exports of Nexus: blocks of segments and markers, and the meaning of three angles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crosscheck.importing.capture import read_vicon, rotations
from seecr.errors import InputFileError

EXPORT = """Segments
100
,,box:box
Frame,Sub Frame,RX,RY,RZ,TX,TY,TZ
,,deg,deg,deg,mm,mm,mm
11,0,0,0,90,1,2,3
12,0,0,0,,,,

Trajectories
100
,,box:one,,,box:two
Frame,Sub Frame,X,Y,Z,X,Y,Z
,,mm,mm,mm,mm,mm,mm
11,0,10,20,30,40,50,60
12,0,11,21,31,41,51,61
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "nexus.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_segments_and_markers_are_read_in_metres(tmp_path: Path) -> None:
    found = read_vicon(written(tmp_path, EXPORT), "xyz")
    assert found.t_s == pytest.approx([0.11, 0.12])
    place, quat = found.bodies["box:box"]
    np.testing.assert_allclose(place, [[1e-3, 2e-3, 3e-3], [np.nan] * 3])
    assert quat is not None and quat[0] == pytest.approx([0.5**0.5, 0, 0, 0.5**0.5])
    assert found.markers["box:two"][1] == pytest.approx([0.041, 0.051, 0.061])


def test_a_rotation_of_unknown_meaning_is_refused_unless_nobody_needs_it(tmp_path: Path) -> None:
    path = written(tmp_path, EXPORT)
    with pytest.raises(InputFileError, match="three numbers of a rotation can mean several things"):
        read_vicon(path)
    assert read_vicon(path, bodies_too=False).bodies == {}


def test_blocks_of_other_frames_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="expected the frames of the first block again"):
        read_vicon(written(tmp_path, EXPORT.replace("12,0,11", "13,0,11")), "xyz")


def test_orders_of_angles_take_each_from_its_own_axis() -> None:
    """Capitals turn with the body, small letters do not; columns are RX, RY, RZ in any order."""
    angles = np.array([[0.1, 0.2, 0.3]])
    about = [
        Rotation.from_rotvec(angle * axis) for angle, axis in zip(angles[0], np.eye(3), strict=True)
    ]
    x, y, z = about
    for order, expected in {"xyz": z * y * x, "XYZ": x * y * z, "zxy": y * x * z}.items():
        assert (rotations(angles, order)[0] * expected.inv()).magnitude() < 1e-12
    assert rotations(angles, "vector").as_rotvec() == pytest.approx(angles)
