"""What a user states about recordings besides the files themselves."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from crosscheck.errors import CrosscheckError
from crosscheck.given import numbers_of
from crosscheck.importing.capture import ROTATIONS
from crosscheck.importing.dwells import REST_FOR
from crosscheck.importing.poses import read_shape
from crosscheck.measurements.data import parse_quantity
from seecr.description.robot import Robot
from seecr.pose import Array

# No axis twice in succession, which would be one rotation.
_ROTATION = re.compile(r"vector|(?:([xyz])(?!\1)){3}|(?:([XYZ])(?!\2)){3}")


@dataclass(frozen=True, eq=False)
class ImportChoices:
    """What the user states about the files.

    Attributes:
        body: name of the rigid body, if there are several.
        markers: names of three or more that make up the body instead.
        shape: [m] positions of markers in the platform's frame, by name.
        points: markers, or positions in the tracker's frame, with their positions in the base
            frame.
        aligned: whether the tracker's frame is the base frame.
        target: (3,) [m] of the body's origin in the platform's frame, with parallel axes.
        up: axis that points up in the file, "y" or "z"; the program's own by default.
        unit: of lengths, if a log's names have none.
        rotation: meaning of three numbers, :data:`crosscheck.importing.capture.ROTATIONS`.
        rest_for: [s]. rest_speed: [m/s]. clock: [s], the tracker's minus the commands'; estimated
            by default.
    """

    body: str | None = None
    markers: tuple[str, ...] = ()
    shape: Mapping[str, Array] = field(default_factory=dict)
    points: Mapping[str, Array] = field(default_factory=dict)
    aligned: bool = False
    target: Array | None = None
    up: str | None = None
    unit: str | None = None
    rotation: str | None = None
    rest_for: float = REST_FOR
    rest_speed: float | None = None
    clock: float | None = None

    @classmethod
    def said(
        cls, robot: Robot, *, markers: str | None, shape: Path | None, points: Sequence[str],
        target: str | None, rest_speed: str | None, **others: Any,
    ) -> ImportChoices:  # fmt: skip
        """The choices as people type them; see ``crosscheck import --help``.

        Raises:
            CrosscheckError, InputFileError: a text that is not valid.
        """
        return cls(
            markers=tuple(name.strip() for name in (markers or "").split(",") if name.strip()),
            shape=read_shape(shape) if shape else {},
            points=dict(_point(text, robot) for text in points),
            target=numbers_of("--target", target) if target else None,
            rest_speed=_speed(rest_speed) if rest_speed else None,
            **others,
        )

    def check(self, form: str) -> None:
        """Refuse choices that are useless for a recording of this form, or contradict each other.

        Raises:
            CrosscheckError: there is one, or an invalid rotation.
        """
        said = [
            (self.aligned and self.points, "--aligned and --point", "one of them: the frame is "
             "known, or points determine it"),
            (self.markers and self.body, "--body and --markers", "one of them: a body of the "
             "file, or markers that form one"),
            (self.shape and not self.markers, "--shape without --markers", "the names of the "
             "markers that form the body"),
            (self.rotation and form != "vicon", f"--rotation with {form}", "it with vicon only: "
             "other formats state what their columns mean"),
            (self.unit and form != "poses", f"--unit with {form}", "it with poses only: other "
             "formats state their units"),
        ]  # fmt: skip
        for wrong, got, expected in said:
            if wrong:
                raise CrosscheckError(f"{got}: expected {expected}")
        if self.rotation and not _ROTATION.fullmatch(self.rotation):
            raise CrosscheckError(f"--rotation: expected {ROTATIONS}, got {self.rotation!r}")


def _point(text: str, robot: Robot) -> tuple[str, Array]:
    """``MARKER=x,y,z``, or ``MARKER=CABLE`` for that cable's exit point."""
    name, _, place = text.rpartition("=")
    if place in robot.cable_names:
        return name, robot.exit_points[robot.cable_names.index(place)]
    return name, numbers_of(f"--point {text}", place)


def _speed(text: str) -> float:
    if not text.endswith("/s"):
        raise CrosscheckError(f"--rest-speed: expected a speed such as 1mm/s, got {text!r}")
    return parse_quantity("--rest-speed", "position", text.removesuffix("/s"))
