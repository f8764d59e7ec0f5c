"""Measurements with MuJoCo as the truth and effects that are not disclosed: a case folder.

``robot.xml`` is what a user would have, ``measured.csv`` and ``measured.toml`` what they would
have measured, and ``answer.sealed`` what the robot really had.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.files import staged, write_text
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.write import write_measurements
from crosscheck.settle.model import compile_model, hindrances, ignored_note
from crosscheck.twin.answer import NAME, Answer, Moves, seal
from crosscheck.twin.hidden import choose, times, values_of
from crosscheck.twin.measure import Truth, measure
from crosscheck.twin.trajectory import Trajectory, trajectory
from seecr.commands import Commands
from seecr.effects import Term
from seecr.mjcf import load_robot
from seecr.pose import Array, quat_from_rotvec, quat_multiply
from seecr.result import Record, Result
from seecr.robot import Robot

# Noise of a tracker, over the mean cable length (30 micrometres on a DemoBot), and of its angles.
_POSITION, _ORIENTATION_RAD = 6e-5, 3.5e-4
# Noise of load cells over the mean tension.
_TENSION = 0.02
# An effect that moves no reading by this many times its noise is made larger, so often.
_VISIBLE, _ENLARGED = 2.0, (1.0, 2.0, 3.0)
# Smaller extents, tried where MuJoCo finds no rest at some commands.
_EXTENTS = (1.0, 0.75, 0.5, 0.35)
# Rows at which it has to rest; the others are left out.
_AT_REST = 0.95

Progress = Callable[[int, str], None]

FILES = ("robot.xml", "measured.csv", "measured.toml", NAME)
"""What a case's folder holds."""


@dataclass(frozen=True, eq=False, repr=False)
class Twin(Result):
    """A twin as made; what it hides is in ``hidden`` and, on disk, sealed.

    Attributes:
        robot: as described.
        measured: what its sensors read, noise included.
        truth: MuJoCo's answers to all commands, before the noise.
        kept: (n,) bool, commands that were measured: those at which MuJoCo came to rest.
        hidden: the effects.
        answer: what the sealed file holds.
        notes: what of the MJCF plays no part in the truth, a sentence or none.
    """

    robot: Robot
    measured: Measurements
    truth: Truth
    kept: NDArray[np.bool_]
    hidden: tuple[Term, ...]
    answer: Answer
    notes: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """What may be told of it: nothing of what it hides."""
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
        head = f"twin of {self.robot.name}, what it hides is in .hidden"
        return [head, *self.measured.lines(), *(f"note: {note}" for note in self.notes)]

    def records(self) -> Sequence[Record]:
        """A record for each row of the measurements."""
        return self.measured.records()


def make_twin(
    robot_path: str | Path,
    seed: int,
    *,
    effects: Sequence[str] | None = None,
    n_effects: int | None = None,
    out: str | Path | None = None,
    tensions: bool = False,
    points: int = 18,
    progress: Progress | None = None,
) -> Twin:
    """Measure a robot that has effects nobody is told of.

    Args:
        robot_path: its MJCF, without them.
        seed: draws effects, their sizes and the noise.
        effects: names of the effects; None lets the seed choose, ``()`` hides none.
        n_effects: how many the seed chooses; None lets it choose that too.
        out: folder for the case; None writes nothing.
        tensions: record tensions too.
        points: of each sweep; 18 make 144 rows.
        progress: called with the number of rows done since the last call, and what is going on.

    Raises:
        CrosscheckError: an effect that no twin can hide, or a robot that MuJoCo cannot rest.
    """
    robot_path = Path(robot_path)
    robot = load_robot(robot_path)
    hidden = choose(robot, _random(seed, 0), effects, n_effects, tensions)
    tell = progress or (lambda rows, now: None)
    made = _at_rest(robot, hidden, points, seed, tensions, tell)
    measured = _read(made, _random(seed, 2), robot).rows(made.at_rest)
    hidden = [one for one, _ in made.alone]
    twin = Twin(
        robot=robot,
        measured=measured,
        truth=made.truth,
        kept=made.at_rest,
        hidden=tuple(hidden),
        answer=_answer(made, robot, seed),
        notes=_notes(robot_path),
    )
    if out is not None:
        _write(twin, robot_path, Path(out))
    return twin


@dataclass(frozen=True, eq=False)
class _Case:
    """What is commanded, and the temperature it is commanded at."""

    way: Trajectory
    temperature: Array

    def commands(self) -> Commands:
        run: Any = np.unique(self.way.run, return_inverse=True)[1]
        return Commands(
            pose=self.way.pose, run=run, time=self.way.t_s, temperature=self.temperature
        )


@dataclass(frozen=True, eq=False)
class _Measured:
    """What MuJoCo said: without effects, with all, and with each alone."""

    case: _Case
    plain: Truth
    truth: Truth
    sigma: Sigma
    alone: list[tuple[Term, Truth]]
    at_rest: NDArray[np.bool_]


def _random(seed: int, stream: int) -> np.random.Generator:
    """Its own random numbers for each purpose: the noise does not depend on what is hidden."""
    return np.random.default_rng([seed, stream])


def _at_rest(
    robot: Robot, hidden: list[Term], points: int, seed: int, tensions: bool, tell: Progress
) -> _Measured:
    """Commands and sizes of effects at which MuJoCo rests, and the effects show."""
    for extent in _EXTENTS:
        case = _case(robot, points, extent, seed)
        plain = measure(robot, case.commands(), progress=lambda n: tell(n, "without effects"))
        if not _mostly(plain.at_rest):
            continue
        sigma = _sigma(robot, plain, tensions)
        alone = [_made_visible(robot, case, one, plain, sigma, tell) for one in hidden]
        if any(one is None for one in alone):
            continue
        fine = [one for one in alone if one is not None]
        truth = _together(robot, case, fine, plain, tell)
        at_rest = truth.at_rest & plain.at_rest
        if _mostly(at_rest):
            return _Measured(case, plain, truth, sigma, fine, at_rest)
    raise CrosscheckError(
        f"robot {robot.name}: MuJoCo finds no stable rest along the twin's commands, however close "
        "to the reference pose; expected a robot whose cables hold its platform around there"
    )


def _mostly(at_rest: NDArray[np.bool_]) -> bool:
    """Whether few rows have to be left out, because nobody can measure a platform that sways."""
    return float(np.mean(at_rest)) >= _AT_REST


def _together(
    robot: Robot, case: _Case, alone: list[tuple[Term, Truth]], plain: Truth, tell: Progress
) -> Truth:
    """The truth with all effects."""
    if len(alone) < 2:
        return alone[0][1] if alone else plain
    effects = [one.effect() for one, _ in alone]
    return measure(robot, case.commands(), effects, progress=lambda n: tell(n, "both effects"))


def _case(robot: Robot, points: int, extent: float, seed: int) -> _Case:
    way = trajectory(robot, points, extent)
    random = _random(seed, 1)
    # a hall that warms up, and somebody opens the door now and then
    t = way.t_s
    rise, period = random.uniform(3.0, 6.0), random.uniform(200.0, 400.0)
    drift = rise * (1.0 - np.exp(-t / 300.0)) + 0.5 * np.sin(2.0 * np.pi * t / period)
    return _Case(way, np.round(20.0 + drift, 2))


def _made_visible(
    robot: Robot, case: _Case, hidden: Term, plain: Truth, sigma: Sigma, tell: Progress
) -> tuple[Term, Truth] | None:
    """The effect, larger where it would drown in the noise; None where MuJoCo finds no rest."""
    best = None
    for factor in _ENLARGED:
        one = times(hidden, factor)
        effects, commands = [one.effect()], case.commands()
        truth = measure(robot, commands, effects, progress=lambda n: tell(n, "with effects"))
        if not _mostly(truth.at_rest & plain.at_rest):
            break
        best = one, truth
        if Moves.of(truth, plain, sigma).max > _VISIBLE:
            break
    return best


def _sigma(robot: Robot, plain: Truth, tensions: bool) -> Sigma:
    length = float(np.mean(robot.nominal_lengths(robot.reference_pose[None])))
    pull = _one_digit(_TENSION * float(np.mean(plain.tensions))) if tensions else None
    return Sigma(_one_digit(_POSITION * length), _ORIENTATION_RAD, pull)


def _one_digit(value: float) -> float:
    return float(f"{value:.0e}")


def _read(made: _Measured, random: np.random.Generator, robot: Robot) -> Measurements:
    """Readings with noise."""
    case, truth, sigma = made.case, made.truth, made.sigma
    assert sigma.position_m is not None and sigma.orientation_rad is not None
    n = len(truth.position)
    noise = random.standard_normal((n, 6))
    turn = quat_from_rotvec(sigma.orientation_rad * noise[:, 3:])
    quat = quat_multiply(turn, truth.quat_wxyz)
    pull: Any = None
    if sigma.tension_N is not None:
        pull = truth.tension_readings + sigma.tension_N * random.standard_normal(
            truth.tension_readings.shape
        )
    return Measurements(
        path=Path("measured.csv"),
        n_cables=robot.n_cables,
        run=case.way.run,
        command_pose=case.way.pose,
        t_s=case.way.t_s,
        position=truth.position + sigma.position_m * noise[:, :3],
        quat_wxyz=quat * np.where(quat[:, :1] < 0.0, -1.0, 1.0),
        tensions=pull,
        temperature_C=case.temperature,
        sigma=sigma,
    )


def _answer(made: _Measured, robot: Robot, seed: int) -> Answer:
    import mujoco

    return Answer(
        robot=robot.name,
        seed=seed,
        values={one.name: values_of(one) for one, _ in made.alone},
        moves_over_noise={
            one.name: Moves.of(truth, made.plain, made.sigma) for one, truth in made.alone
        },
        all_move_over_noise=Moves.of(made.truth, made.plain, made.sigma),
        sigma={kind: value for kind, value in asdict(made.sigma).items() if value is not None},
        poses=int(np.sum(made.at_rest)),
        truth=f"MuJoCo {mujoco.__version__}",
    )


def _write(twin: Twin, robot_path: Path, out: Path) -> None:
    with staged(out) as folder:
        write_measurements(folder / "measured.csv", twin.measured)
        shutil.copyfile(robot_path, folder / "robot.xml")
        _check_alone(folder / "robot.xml", robot_path)
        write_text(folder / NAME, seal(twin.answer))


def _notes(path: Path) -> tuple[str, ...]:
    """What of the MJCF the truth leaves out: it is built anew from the robot's numbers."""
    found = hindrances(compile_model(path))
    return (ignored_note(path, found),) if found else ()


def _check_alone(copy: Path, source: Path) -> None:
    """A robot that needs other files would not be whole in the case folder."""
    try:
        load_robot(copy)
    except Exception:
        raise CrosscheckError(
            f"{source}: needs files beside it, which a case folder does not have; expected an "
            "MJCF that stands alone"
        ) from None
