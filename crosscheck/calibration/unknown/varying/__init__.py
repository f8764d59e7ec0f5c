"""What an unknown effect may change: columns that compete with known effects, and their words."""

from __future__ import annotations

from crosscheck.calibration.unknown.varying.anywhere import in_all_readings, varying, widening
from crosscheck.calibration.unknown.varying.columns import SMOOTH
from crosscheck.calibration.unknown.varying.in_time import varying_in_time
from crosscheck.calibration.unknown.varying.kinds import Varying

__all__ = ["SMOOTH", "Varying", "in_all_readings", "varying", "varying_in_time", "widening"]
