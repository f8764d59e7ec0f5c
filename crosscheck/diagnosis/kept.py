"""The model that a diagnosis found: that which was given, with the missing effects added."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from crosscheck.diagnosis.found import found_covariance, found_effects, refitted
from crosscheck.given import GivenModel, basis_of
from crosscheck.measurements.data import Measurements
from crosscheck.model.write import provenance_of, renewed, with_fit
from seecr.description.robot import Robot
from seecr.effects import Terms
from seecr.prediction.model import Model

if TYPE_CHECKING:
    from crosscheck.diagnosis.result import Diagnosis

__all__ = ["Diagnosed"]


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """What a diagnosis is of.

    Attributes:
        robot: the robot. data: its measurements. model: the model as it was given.
    """

    robot: Robot
    data: Measurements
    model: Model

    @classmethod
    def of(cls, robot: Robot, data: Measurements, given: GivenModel, terms: Terms) -> Diagnosed:
        """The same of a model as callers give it, with its effects as they were read."""
        basis = basis_of(given, robot)
        own = basis if isinstance(given, Model | str | Path) else replace(basis, terms=terms)
        return cls(robot, data, own)

    def refitted(self, found: Diagnosis) -> tuple[str, ...]:
        """Effects of the model that agree with the data only with other values than it has."""
        return refitted(found, self.model)

    def with_found(self, found: Diagnosis) -> Model | None:
        """The model with what was found, all values fitted together; None without a verdict.

        With nothing added or fitted again it is the model as it was given.
        """
        if found.refusal is not None:
            return None
        if not found.missing and not self.refitted(found):
            return self.model
        names = [effect.effect for effect in found.missing]
        errors = {"before": found.before, "after": found.after, "held_out": found.held_out}
        source = provenance_of(self.data.name, "crosscheck diagnose")
        fitted, covariance = found_effects(found), found_covariance(found)
        new = with_fit(self.model, fitted, names, source, errors, covariance)
        return renewed(new, self.robot, self.data)
