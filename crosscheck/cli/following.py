"""The last line of each command: the next one, with its arguments."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from seecr.cli.following import following, given_with

if TYPE_CHECKING:
    from crosscheck import Comparison, Diagnosis

_MODEL = "model.toml"
# Rows that a plan chooses where nobody said how many.
_ROWS = 40


def after_comparison(
    found: Comparison, robot: Path, data: Sequence[Path], model: Path | None
) -> str:
    """What is missing; where nothing is, what these data could not have shown, or using it."""
    if not found.is_noise:
        return following("crosscheck", "diagnose", robot, *data, *given_with(None, model))
    if model is None:
        return following("crosscheck", "plan", robot, data[0])
    return following("seecr", "correct", robot, data[0], "--model", model)


def after_diagnosis(
    found: Diagnosis, robot: Path, data: Sequence[Path], model: Path | None, kept: Path | None,
    out: Path,
) -> str:  # fmt: skip
    """Adding what was found, calibrating all, or measuring more."""
    from crosscheck import DiagnosisVerdict

    files, to = (robot, *data), ("--model", model or _MODEL)
    match found.verdict:
        case DiagnosisVerdict.MANY_EFFECTS:
            return following("crosscheck", "calibrate", *files, *to)
        case DiagnosisVerdict.NO_EFFECT_MISSING if model is not None:
            return following("seecr", "correct", robot, data[0], "--model", model)
        case DiagnosisVerdict.NO_VERDICT:
            return following("crosscheck", "plan", robot, "--rows", _ROWS)
    if not found.missing:
        return following("crosscheck", "plan", robot, data[0])
    if kept is not None:
        return following("crosscheck", "compare", *files, "--model", kept)
    listed = ("--all-from", out / "diagnosis.json")
    return following("crosscheck", "add", *listed, *files, *to)


def after_fit(is_noise: bool, written: bool, robot: Path, data: Sequence[Path], model: Path) -> str:
    """Holding the new model against the data, or looking for what else is missing."""
    there = given_with(None, model) if written or model.exists() else ()
    verb = "compare" if is_noise and written else "diagnose"
    return following("crosscheck", verb, robot, *data, *there)


def after_plan(robot: Path, poses: Path) -> str:
    """Once the poses have been measured."""
    return following("crosscheck", "diagnose", robot, poses) + "  # once its poses are measured"
