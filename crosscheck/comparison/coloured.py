"""Autocorrelated noise, or noise with outliers, that explains what a model leaves.

The error of a tracker is smooth in time. Size and autocorrelation of the noise maximise the
likelihood, and residuals are whitened accordingly. What is left is noise if its size is plausible,
outliers do not lie side by side, neighbours are no longer correlated, and neither a smooth field
over the workspace nor anything that varies in time explains anything.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.noise.colour import WHITE, chain_of
from crosscheck.calibration.noise.restricted import estimate
from crosscheck.calibration.noise.robust import outliers, row_weights
from crosscheck.calibration.unknown.beside import unknown_beside
from crosscheck.calibration.unknown.not_noise import is_not_noise
from crosscheck.fit.least_squares.problem import Problem, kinds_stated
from crosscheck.fit.least_squares.state import State
from seecr.counted import counted
from seecr.effects import Terms
from seecr.pose import Array

# Noise that is larger than assumed by this factor is not the assumed noise.
_LARGER = 1.5
# Fewer readings than this do not show how noise is correlated.
_LEAST_READINGS = 60


@dataclass(frozen=True)
class Coloured:
    """Estimated noise, by kind of reading.

    Attributes:
        scale: its size relative to the assumed one.
        rho: correlation of successive rows of a run.
        outliers: number of outlying rows.
        open: whether this noise, whose size was not stated, is so much larger than neighbouring
            rows differ that something missing, which varies smoothly, looks the same.
    """

    scale: dict[str, float]
    rho: dict[str, float]
    outliers: int
    open: bool = False

    @property
    def words(self) -> str:
        """The noise in a few words."""
        sizes = ", ".join(
            f"{name} {self.scale[name]:.2f} times the assumed noise"
            + (f", with a correlation of {rho:.2f} from row to row" if rho > 0.05 else "")
            for name, rho in self.rho.items()
        )
        return sizes + (f"; {counted(self.outliers, 'outlier')}" if self.outliers else "")


def coloured_noise(problem: Problem, state: State, factor: Array) -> Coloured | None:
    """The residuals as autocorrelated noise with outliers; None if they are not noise.

    Args:
        problem: the data. state: the model's predictions. factor: :meth:`Problem.noise`.
    """
    if not state.valid or problem.n_readings < _LEAST_READINGS:
        return None
    stated = [kind.name for kind in kinds_stated(problem)]
    setting = Setting(problem, factor, chain_of(problem))
    weight = row_weights(setting.chain, WHITE, state.white)
    none, blank = np.zeros(0), np.zeros((len(state.white), 0))
    colour = estimate(setting.chain, WHITE, weight, blank, state.white, none)
    weight = row_weights(setting.chain, colour, state.white)
    left = JointFit(state.of(Terms()), blank, none, colour, weight, settled=True)
    scale, rho = colour.by_kind(problem)
    if any(scale[name] > _LARGER * _too_small(name in stated, rho[name]) for name in scale):
        return None
    if is_not_noise(setting, left, stated):
        return None
    if unknown_beside(setting, left, len(stated) == len(scale)).is_there:
        return None
    far = int(outliers(setting.chain, weight, problem.data.n_rows).sum())
    return Coloured(scale, rho, far, any(size > _LARGER for size in scale.values()))


def _too_small(stated: bool, rho: float) -> float:
    """How many times too small the assumed noise may be, with correlation rho from row to row.

    Stated noise is not. Estimates from third differences, with the weights 1, -3, 3, -1, see only a
    part of what neighbouring rows have in common.
    """
    return 1.0 if stated else float((1.0 - 1.5 * rho + 0.6 * rho**2 - 0.1 * rho**3) ** -0.5)
