"""Measurements with MuJoCo as the truth and effects that are not disclosed: a case folder.

``robot.xml`` is what a user would have, ``measured.csv`` and ``measured.toml`` what they would have
measured, and ``answer.sealed`` what the robot really had.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.given import GivenRobot, check_case, copy_robot, file_of, robot_of
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.read import GivenCommands, commands_of
from crosscheck.measurements.write import write_measurements
from crosscheck.twin.hidden import NAME, Answer, GivenHidden, choose, others, seal, values_of
from crosscheck.twin.lab import (
    EXTENTS,
    Lab,
    Measured,
    Progress,
    key_of,
    lacking_in,
    random_of,
    read_of,
    rest_of,
    sized,
    sweeps,
)
from crosscheck.twin.measure import Truth
from crosscheck.twin.robot import TRUE_EFFECTS
from seecr.arguments import whole
from seecr.description.mjcf import quiet_mujoco
from seecr.description.robot import Robot
from seecr.effects import Term
from seecr.files import write_text
from seecr.folders import staged
from seecr.result import Record, Result

# Poses that show one effect in four would be refused in three of a hundred seeds.
_TRIES = 12

FILES = ("robot.xml", "measured.csv", "measured.toml", NAME)
"""The files of a case's folder."""


@dataclass(frozen=True, eq=False, repr=False)
class Twin(Result):
    """A twin as made; what it hides is in ``hidden`` and, on disk, sealed.

    Attributes:
        robot: as described.
        measured: its sensors' readings, noise included.
        truth: MuJoCo's answers to all commands, without noise.
        kept: (n,) bool, commands that were measured: those at which MuJoCo came to rest.
        hidden: the effects.
        answer: the content of the sealed file.
        notes: what the truth leaves out of the MJCF, and notes about the given poses.
    """

    robot: Robot
    measured: Measurements
    truth: Truth
    kept: NDArray[np.bool_]
    hidden: tuple[Term, ...]
    answer: Answer
    notes: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """What may be disclosed: nothing of what it hides."""
        return {
            "robot": self.robot.name,
            "seed": self.answer.seed,
            "rows": self.measured.n_rows,
            "runs": len(self.measured.runs),
            "sigma": self.answer.sigma,
            "notes": self.notes,
        }

    def lines(self) -> list[str]:
        """What was measured; not what is hidden."""
        head = f"twin of {self.robot.name}; its hidden effects are in .hidden"
        return [head, *self.measured.lines(), *(f"note: {note}" for note in self.notes)]

    def records(self) -> Sequence[Record]:
        """One row for each row of the measurements."""
        return self.measured.records()


@quiet_mujoco()
def make_twin(
    robot: GivenRobot,
    seed: int,
    *,
    effects: GivenHidden | None = None,
    n_effects: int | None = None,
    out: str | Path | None = None,
    tensions: bool = False,
    points: int = 18,
    poses: GivenCommands | None = None,
    sigma: Sigma | None = None,
    maybe_none: bool = False,
    progress: Progress | None = None,
) -> Twin:
    """Measure a robot with undisclosed effects.

    Args:
        robot: without effects: its MJCF, the name of a shipped one, or as read from its file.
        seed: of effects, their sizes and the noise.
        effects: the effects, by names or classes, whose sizes are drawn, or with values; None lets
            the seed choose, ``()`` hides none. Effects of one's own act by their own law.
        n_effects: how many the seed chooses; None lets it choose that too, one or two.
        out: folder for the case; None writes nothing.
        tensions: record tensions too.
        points: of each sweep; 18 make 144 rows.
        poses: instead of the sweeps: poses (n, 7), or commands, loads and way points, or their
            file. If some rows have readings, those without are way points; a list of commands has
            none. With the same seed and noise it is the same robot as along the sweeps.
        sigma: noise; kinds that are not stated are those of a good tracker.
        maybe_none: whether the seed may also hide nothing, or what these poses hardly show. Else an
            effect that moves no reading clearly above its noise is exchanged for the seed's next.
        progress: called with the number of rows done since the last call, and what is going on.

    Returns:
        the measurements, and what was hidden in them.

    Raises:
        CrosscheckError: an effect that needs what the commands lack, a robot that MuJoCo cannot
            bring to rest, or poses that show no effect.
        InputFileError: poses that cannot be read, or files in ``out`` that are not from an older
            twin.
        InputError: a robot without a file, or with numbers other than its file's.

    Example:
        ``crosscheck.make_twin(robot, 7, effects=["pulley_radius"], points=4)``
    """
    seed, points = whole(seed, "seed"), whole(points, "points", least=1)
    n_effects = None if n_effects is None else whole(n_effects, "n_effects")
    path, robot = file_of(robot), robot_of(robot)
    if out is not None:
        check_case(out, FILES, path)
    given = None if poses is None else commands_of(poses, robot)
    stated = sigma or (Sigma() if given is None else given.sigma)
    tensions = tensions or stated.tension_N is not None
    lacking = {} if given is None else lacking_in(given)
    draws = effects is None and not maybe_none
    random = random_of(seed, 0)
    hidden = choose(robot, random, effects, n_effects, tensions, lacking, least=int(draws))
    cases = [given] if given is not None else [sweeps(robot, points, e, seed) for e in EXTENTS]
    tell = progress or (lambda rows, now: None)
    commanded = () if given is None else key_of(given)
    lab = Lab(robot, seed, stated, tensions, tell, commanded)
    spare = islice(others(robot, random_of(seed, 4), hidden, lacking), _TRIES)
    while True:
        if given is None:
            made = rest_of(lab, cases, hidden)
        else:
            made = rest_of(lab, cases, sized(lab, points, hidden), enlarged=(1.0,))
        unseen = made.unseen(given is not None) if draws else set()
        if not unseen:
            break
        kept = [one for one in hidden if one.name not in unseen]
        hidden = [*kept, *islice(spare, len(unseen))]
        if len(hidden) < len(kept) + len(unseen):
            raise CrosscheckError(
                f"{robot.source}: these poses show too few effects "
                "clearly above the noise; expected poses further apart, less noise, or --maybe-none"
            )
    measured = read_of(made, random_of(seed, 2, commanded))
    twin = Twin(
        robot=robot,
        # of a user's own commands all are kept: those not at rest count as way points
        measured=measured if given is not None else measured.rows(made.at_rest),
        truth=made.truth,
        kept=made.at_rest,
        hidden=tuple(Term(one.layout, one.vector) for one, _ in made.alone),
        answer=_answer(made, robot, seed, measured.sigma),
        notes=(*robot.notes, *(() if given is None else given.notes)),
    )
    if out is not None:
        # commands made in Python name a file that need not be there
        read = [given.path] if given is not None and given.path.exists() else []
        with staged(Path(out), read=read) as folder:
            write_measurements(folder / "measured.csv", twin.measured)
            copy_robot(path, folder / "robot.xml", robot)
            write_text(folder / NAME, seal(twin.answer))
    return twin


def _answer(made: Measured, robot: Robot, seed: int, sigma: Sigma) -> Answer:
    import mujoco

    # MuJoCo has no means for effects of users' own
    own = [one.name for one, _ in made.alone if one.name not in TRUE_EFFECTS]
    law = f"; {', '.join(own)} by its own law in SEECR" if own else ""
    return Answer(
        robot=robot.name,
        seed=seed,
        values={one.name: values_of(one) for one, _ in made.alone},
        moves_over_noise={one.name: made.moves(truth) for one, truth in made.alone},
        all_move_over_noise=made.moves(made.truth),
        sigma=sigma.stated,
        poses=int(np.sum(made.at_rest)),
        truth=f"MuJoCo {mujoco.__version__}{law}",
    )
