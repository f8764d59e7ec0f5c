"""Text panels of a case: what to look at, and the numbers of the current pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crosscheck.recording import words
from crosscheck.recording.material import Material
from crosscheck.suite.verdicts import Verdict
from seecr.counted import counted
from seecr.pose import pose_difference
from seecr.recording.stream import Index, Recording, opening

READ_ME, NOW = "text/read_me", "text/now"
_LISTED = 12
_KINDS = {
    "sweep": "poses along a line",
    "random": "poses at random",
    "starts": "starts of one command",
}
_TITLES = {
    "position_m": "position",
    "orientation_rad": "orientation",
    "tension_N": "tension",
    "settled_position_m": "position, plain settling",
    "settled_orientation_rad": "orientation, plain settling",
}


class Panels:
    """Writes the texts of a case."""

    def __init__(self, recording: Recording, material: Material) -> None:
        self.recording, self.material = recording, material

    def over_poses(self, index: Index) -> None:
        """The guide, and the numbers of each pose."""
        self.recording.text(READ_ME, self._guide())
        self.recording.texts(NOW, index, [self._pose(i) for i in range(self.material.count)])

    def over_settling(self, index: Index) -> None:
        """The numbers of each instant of the settling."""
        material, motion = self.material, self.material.motion
        assert motion is not None
        gap = pose_difference(motion.pose, material.seecr.pose[material.watched])
        away = np.stack([np.linalg.norm(gap[:, :3], axis=1), np.linalg.norm(gap[:, 3:], axis=1)], 1)
        loose = material.settling.slack
        texts = [
            words.instant(float(t), float(energy), away[k], self._loose(loose[k]))
            for k, (t, energy) in enumerate(zip(motion.t_s, motion.kinetic_energy, strict=True))
        ]
        self.recording.texts(NOW, index, texts)

    def _guide(self) -> str:
        material = self.material
        case, robot = material.result.case, material.robot
        sentence = (
            f"{counted(robot.n_cables, 'cable')}, {robot.mass:g} kg, "
            f"{robot.weight:.3g} N of weight; "
            f"{material.count} {_KINDS.get(case.kind, 'poses')}."
        )
        watched = material.watched if material.motion is not None else None
        return words.read_me(
            material.name,
            sentence,
            material.count,
            watched,
            self._worst(),
            self._findings(),
            lines=material.is_sweep,
            along=opening(material.index)[0],
        )

    def _findings(self) -> list[str]:
        """Poses by verdict, except those that agree."""
        result = self.material.result
        lines = []
        for verdict in Verdict:
            rows = [str(i) for i in np.flatnonzero(result.verdict == verdict)]
            if verdict is not Verdict.AGREES and rows:
                listed = ", ".join(rows[:_LISTED]) + (" …" if len(rows) > _LISTED else "")
                lines.append(f"pose {listed}: {verdict.value}")
        return lines

    def _worst(self) -> list[tuple[str, ...]]:
        """Largest difference of each quantity, its pose, and the allowance there."""
        return [
            (
                _TITLES[name],
                words.number(worst.value, name.rsplit("_", 1)[1]),
                str(worst.pose),
                words.number(worst.allowed, name.rsplit("_", 1)[1]),
            )
            for name, worst in self.material.result.worst.items()
        ]

    def _pose(self, i: int) -> str:
        material, command = self.material, self.material.command[i]
        gap, pose = material.gap, material.seecr.pose[i]
        rows = [
            ("command", words.position(command)),
            ("turned", words.orientation(command)),
            ("SEECR moves by", words.shift(pose, command)),
            ("SEECR turns by", words.turn(pose, command)),
            ("slack", self._loose(material.seecr.slack[i])),
            ("MuJoCo differs by", words.number(gap.position_m[i], "m")),
            ("in orientation by", words.number(gap.orientation_rad[i], "rad")),
            ("in tension by", words.number(gap.tension_N[i], "N")),
        ]
        verdict = material.result.verdict[i].value
        more = "".join(f.text + "\n\n" for f in material.result.findings if f.pose == i)
        head = f"{words.pose_heading(i, material.count)}\n{more or verdict}\n\n"
        return head + words.table(rows)

    def _loose(self, which: NDArray[np.bool_]) -> str:
        names = self.material.robot.cable_names
        return ", ".join(n for n, yes in zip(names, which, strict=True) if yes) or "none"
