"""What joints leave a platform no way to do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rectangle import RECTANGLE
from three_cables import THREE

from seecr.description.joints import locked
from seecr.description.robot import Joint


def test_joints_lock_what_none_of_them_changes() -> None:
    assert not locked(RECTANGLE).any()
    assert locked(THREE).tolist() == [False, True, False, True, False, True]
    slides = replace(THREE, joints=THREE.joints[:2])
    assert locked(slides).tolist() == [False, True, False, True, True, True]
    x, y = np.eye(3)[:2]
    home = THREE.reference_pose[:3]
    # two hinges turn the platform about every axis; one beside its origin moves that as well
    gimbal = replace(
        THREE, joints=tuple(Joint("hinge", n, a, home) for n, a in (("x", x), ("y", y)))
    )
    assert locked(gimbal).tolist() == [True, True, True, False, False, False]
    door = replace(THREE, joints=(Joint("hinge", "y", y, home + 0.5 * x),))
    assert locked(door).tolist() == [False, True, False, True, False, True]
