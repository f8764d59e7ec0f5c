"""What a twin hides, and the file that keeps it from being read by accident.

The file is packed, not encrypted: neither a person who looks into the folder nor a command that
searches it should learn what was hidden before they mean to.
"""

from __future__ import annotations

import base64
import binascii
import json
import textwrap
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.measurements.data import Sigma
from crosscheck.twin.measure import Truth
from seecr.errors import InputFileError
from seecr.files import path_of, plain, read_text
from seecr.pose import pose_difference

NAME = "answer.sealed"
_FIRST_LINE = "# What this twin hides. To see it: crosscheck twin --open"
_EXPECTED = f"expected a file {NAME} of crosscheck twin"


@dataclass(frozen=True)
class Moves:
    """Largest and rms change of the readings, relative to their noise."""

    max: float
    rms: float

    @classmethod
    def of(cls, truth: Truth, plain: Truth, sigma: Sigma) -> Moves:
        """The change from the plain truth to another, at the rows where both are at rest."""
        rows = truth.at_rest & plain.at_rest
        a = np.concatenate([truth.position, truth.quat_wxyz], axis=1)[rows]
        b = np.concatenate([plain.position, plain.quat_wxyz], axis=1)[rows]
        assert sigma.position_m is not None and sigma.orientation_rad is not None
        change = pose_difference(a, b) / np.repeat([sigma.position_m, sigma.orientation_rad], 3)
        if sigma.tension_N is not None:
            pull = (truth.tension_readings - plain.tension_readings)[rows] / sigma.tension_N
            change = np.concatenate([change, pull], axis=1)
        return cls(float(np.max(np.abs(change))), float(np.sqrt(np.mean(change**2))))


@dataclass(frozen=True)
class Answer:
    """What was hidden in a twin's measurements.

    Attributes:
        robot: its name; seed: of everything that was drawn.
        values: by effect and parameter, in the parameter's unit; empty if nothing is hidden.
        moves_over_noise: the change of the readings by each effect alone.
        all_move_over_noise: the change by all of them.
        sigma: noise of the readings, by kind.
        poses: number of rows measured.
        truth: what measured them.
    """

    robot: str
    seed: int
    values: dict[str, dict[str, float]]
    moves_over_noise: dict[str, Moves]
    all_move_over_noise: Moves
    sigma: dict[str, float]
    poses: int
    truth: str

    @property
    def hidden(self) -> list[str]:
        """Names of the effects; empty if nothing is hidden."""
        return list(self.values)

    def as_json(self) -> dict[str, Any]:
        """As in the file; ``hidden`` is ``["null"]`` if nothing is hidden."""
        return {"hidden": self.hidden or ["null"], **asdict(self)}

    @classmethod
    def of_json(cls, document: Mapping[str, Any]) -> Answer:
        """The answer that :meth:`as_json` described.

        Raises:
            KeyError, TypeError: the document is something else.
        """
        moves = {name: Moves(**one) for name, one in document["moves_over_noise"].items()}
        together = Moves(**document["all_move_over_noise"])
        rest = {
            key: document[key] for key in ("robot", "seed", "values", "sigma", "poses", "truth")
        }
        return cls(moves_over_noise=moves, all_move_over_noise=together, **rest)


def seal(answer: Answer) -> str:
    """The text of a sealed file."""
    packed = zlib.compress(json.dumps(plain(answer)).encode("utf-8"), 9)
    lines = textwrap.wrap(base64.b64encode(packed).decode("ascii"), 76)
    return "\n".join([_FIRST_LINE, *lines]) + "\n"


def unseal(path: str | Path) -> Answer:
    """The answer in a sealed file, or in the case folder that holds one.

    Raises:
        InputFileError: there is no such file, or it is not a sealed answer.
        InputError: no path.
    """
    path = path_of(path, "a sealed answer")
    file = path / NAME if path.is_dir() else path
    first, _, body = read_text(file, _EXPECTED).partition("\n")
    try:
        if first != _FIRST_LINE:
            raise ValueError
        return Answer.of_json(json.loads(zlib.decompress(base64.b64decode(body))))
    except (ValueError, KeyError, TypeError, zlib.error, binascii.Error):
        raise InputFileError.at(file, f"is not a sealed answer; {_EXPECTED}") from None
