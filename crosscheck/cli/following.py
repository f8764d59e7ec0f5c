"""The last line of each command: the next one, with its arguments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from seecr.cli.following import following, given_with
from seecr.columns.headers import columns_said

if TYPE_CHECKING:
    from crosscheck import Comparison, Diagnosis

_MODEL = "model.toml"
_ROWS = 40  # that a plan chooses where nobody said how many


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

    def then(self, verb: str, *words: object) -> str:
        """The line that names a command of crosscheck, with ``--sigma`` and ``--columns``."""
        noise = (word for text in self.sigmas for word in ("--sigma", text))
        said = ",".join(f"{theirs}={ours}" for theirs, ours in columns_said().items())
        return following("crosscheck", verb, *words, *noise, *(["--columns", said] * bool(said)))


def after_comparison(found: Comparison, given: Given) -> str:
    """What is missing; where nothing is, what these data could not have shown, or using it."""
    files = (given.robot, *given.data)
    if found.refusal is not None:
        return given.then("plan", given.robot, "--rows", _ROWS)
    if not found.is_noise:
        return given.then("diagnose", *files, *given_with(None, given.model))
    if given.model is None:
        return given.then("plan", *files[:2])
    return _using(given, given.model)


def after_diagnosis(found: Diagnosis, given: Given, kept: Path | None, out: Path) -> str:
    """Adding what was found, calibrating all, or measuring more.

    A model that agrees only with other values is used where these were kept, else gets them.
    """
    from crosscheck import DiagnosisVerdict

    files, to = (given.robot, *given.data), ("--model", given.model or _MODEL)
    match found.verdict:
        case DiagnosisVerdict.MANY_EFFECTS:
            return given.then("calibrate", *files, *to)
        case DiagnosisVerdict.NO_EFFECT_MISSING if given.model is not None:
            if found.refitted and kept is None:
                return given.then("add", found.refitted[0], *files, *to, "--refit")
            return _using(given, kept or given.model)
        case DiagnosisVerdict.NO_VERDICT:
            return given.then("plan", given.robot, "--rows", _ROWS)
    if not found.missing:
        return given.then("plan", *files[:2])
    if kept is not None:
        return given.then("compare", *files, "--model", kept)
    return given.then("add", "--all-from", out / "diagnosis.json", *files, *to)


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
    return given.then(verb, given.robot, *given.data, *model)
