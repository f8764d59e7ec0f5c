"""The last line of each command: the next one, with its arguments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from seecr.cli.following import Words, following, given_with

if TYPE_CHECKING:
    from crosscheck import Comparison, Diagnosis, Measurements

_MODEL = "model.toml"
# Rows that a plan chooses where nobody said how many.
_ROWS = 40


@dataclass(frozen=True)
class Given:
    """What a command was given that the next one needs too.

    Attributes:
        robot, data, model: the files. sigmas: of ``--sigma``.
        lengths: whether the data are commanded in lengths, which no pose is known of.
        history: whether rows of the model depend on the rows before, so that no map knows it.
    """

    robot: Path
    data: Sequence[Path]
    model: Path | None = None
    sigmas: Sequence[str] = ()
    lengths: bool = False
    history: bool = False

    @classmethod
    def with_data(
        cls, measured: Measurements, robot: Path, data: Sequence[Path], model: Path | None,
        sigmas: Sequence[str], history: bool = False,
    ) -> Given:  # fmt: skip
        """The same of files that were read."""
        return cls(robot, data, model, sigmas, measured.command_lengths is not None, history)

    @property
    def options(self) -> Words:
        """``--sigma`` again."""
        return noise(self.sigmas)


def noise(sigmas: Sequence[str]) -> Words:
    """``--sigma`` as it was given."""
    return tuple(word for text in sigmas for word in ("--sigma", text))


def after_comparison(found: Comparison, given: Given) -> str:
    """What is missing; where nothing is, what these data could not have shown, or using it."""
    files = (given.robot, *given.data)
    if found.refusal is not None:
        return following("crosscheck", "plan", given.robot, "--rows", _ROWS, *given.options)
    if not found.is_noise:
        model = given_with(None, given.model)
        return following("crosscheck", "diagnose", *files, *model, *given.options)
    if given.model is None:
        return following("crosscheck", "plan", *files[:2], *given.options)
    return _using(given, given.model)


def after_diagnosis(found: Diagnosis, given: Given, kept: Path | None, out: Path) -> str:
    """Adding what was found, calibrating all, or measuring more.

    A model that agrees only with other values is used where these were kept, else gets them.
    """
    from crosscheck import DiagnosisVerdict

    files, to = (given.robot, *given.data), ("--model", given.model or _MODEL)
    match found.verdict:
        case DiagnosisVerdict.MANY_EFFECTS:
            return following("crosscheck", "calibrate", *files, *to, *given.options)
        case DiagnosisVerdict.NO_EFFECT_MISSING if given.model is not None:
            if found.refitted and kept is None:
                again = (found.refitted[0], *files, *to, "--refit", *given.options)
                return following("crosscheck", "add", *again)
            return _using(given, kept or given.model)
        case DiagnosisVerdict.NO_VERDICT:
            return following("crosscheck", "plan", given.robot, "--rows", _ROWS, *given.options)
    if not found.missing:
        return following("crosscheck", "plan", *files[:2], *given.options)
    if kept is not None:
        return following("crosscheck", "compare", *files, "--model", kept, *given.options)
    listed = ("--all-from", out / "diagnosis.json")
    return following("crosscheck", "add", *listed, *files, *to, *given.options)


def _using(given: Given, model: Path) -> str:
    """Telling the winches what brings the platform to poses; a map, where none are known.

    What a map would refuse is swept instead.
    """
    if given.lengths and given.history:
        return following("seecr", "sweep", given.robot, given.data[0], "--model", model)
    if given.lengths:
        return following("seecr", "map", given.robot, "--model", model)
    line = following("seecr", "correct", given.robot, given.data[0], "--model", model)
    return f"{line}  # corrects the poses commanded there; any CSV of wanted poses will do"


def after_fit(is_noise: bool, written: bool, given: Given) -> str:
    """Comparing the new model with the data, or looking for what else is missing."""
    there = written or (given.model is not None and given.model.exists())
    model = given_with(None, given.model) if there else ()
    verb = "compare" if is_noise and written else "diagnose"
    return following("crosscheck", verb, given.robot, *given.data, *model, *given.options)


def after_plan(robot: Path, poses: Path, sigmas: Sequence[str] = ()) -> str:
    """Once the poses have been measured."""
    line = following("crosscheck", "diagnose", robot, poses, *noise(sigmas))
    return f"{line}  # once these poses are measured"
