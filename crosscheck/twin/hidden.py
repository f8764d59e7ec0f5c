"""The effects that a twin hides, drawn from its seed, and the file that seals them."""

from __future__ import annotations

import base64
import binascii
import json
import math
import textwrap
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.measurements.data import Sigma
from crosscheck.twin.measure import Truth
from crosscheck.twin.robot import TRUE_EFFECTS
from seecr.counted import counted
from seecr.description.robot import Robot
from seecr.effects import Effect, GivenEffect, Layout, Term, class_of, effect_named, layout_of
from seecr.errors import InputFileError
from seecr.files import path_of, plain, read_text
from seecr.pose import pose_difference, transform_points

# Probabilities that a seed hides none, one and two effects.
_SHARES = (0.2, 0.6, 0.2)
# Only tensions show this effect, so it is drawn after all others, with this probability: the poses
# of a seed are the same with and without tensions.
_OF_TENSIONS, _ALSO = "tension_scale", 0.1
# Range of sizes, in expected sizes: for an effect with one number, and for each of several.
_ONE, _SEVERAL = (1.0, 2.0), (0.5, 2.0)
# A cable that softens as it stretches breaks in the end: these effects only stiffen.
_UPWARDS = ("nonlinear_elasticity",)
# Sheaves need anchor points this far aside of exit points, in cable lengths.
_ASIDE = 0.15

CONTAINED = ("length_scale",)
"""Never drawn, since another effect contains it: the same gain for all drums is a case of drum
gains.
"""

Generator = np.random.Generator

GivenHidden: TypeAlias = Sequence[GivenEffect | Term] | GivenEffect | Term
"""Effects that a twin is to hide: those with values have these, of the others they are drawn."""


def values_of(term: Term) -> dict[str, float]:
    """Values by the parameters' names."""
    return dict(zip(term.layout.names, map(float, term.vector), strict=True))


def times(term: Term, factor: float) -> Term:
    """An effect ``factor`` times as large, within its bounds; shapes and what is fixed are kept."""
    layout = term.layout
    grown = layout.null + factor * (term.vector - layout.null)
    kept = layout.shape | term.knowledge.fixed
    return term.with_vector(np.where(kept, term.vector, np.clip(grown, layout.lower, layout.upper)))


def choose(
    robot: Robot,
    random: Generator,
    given: GivenHidden | None = None,
    count: int | None = None,
    tensions: bool = False,
    lacking: Mapping[str, str] | None = None,
    least: int = 0,
) -> list[Term]:
    """Draw the effects of a twin.

    What a seed hides does not depend on the commands: measured again, it is the same robot.

    Args:
        robot: for its expected sizes.
        random: of the twin's seed.
        given: these effects, with the sizes that they have if any; None draws them.
        count: how many to draw; None draws that too.
        tensions: whether tensions are recorded: then their scale may be hidden too, if ``given``
            and ``count`` are not given. All else is drawn as without tensions.
        lacking: data needed by effects that the commands do not have, in words.
        least: of the number that is drawn.

    Raises:
        InputError: something else than effects.
        CrosscheckError: more effects than there are, or effects that need data which the commands
            lack; those chosen by the seed are not named.
    """
    lacking, free = lacking or {}, given is None and count is None
    sized: dict[str, Term] = {}
    if given is not None:
        every = [given] if isinstance(given, str | type | Effect | Term) else list(given)
        terms = [Term.of(robot, one) if isinstance(one, Effect) else one for one in every]
        sized = {one.name: Term(one.layout, one.vector) for one in terms if isinstance(one, Term)}
        names = [one.name if isinstance(one, Term) else class_of(one).name for one in terms]
    else:
        names = _drawn(robot, random, count, least)
        if want := _wanted(names, lacking):
            raise CrosscheckError(
                f"the effects that this seed hides need {want}; expected commands that have them, "
                "or another seed"
            )
    for name in names:
        if want := _wanted([name], lacking):  # its error lists known effects
            raise CrosscheckError(f"effect {name}: needs {want}; expected commands that have them")
    if len(set(names)) != len(names):
        raise CrosscheckError(f"effects {', '.join(names)}: expected each at most once")
    drawn = [
        sized[name].fixed()
        if name in sized
        else _with_numbers(layout_of(name, robot), robot, random)
        for name in names
    ]
    if tensions and free and random.random() < _ALSO:
        drawn.append(_with_numbers(layout_of(_OF_TENSIONS, robot), robot, random))
    # with sheaves, MuJoCo's truth only has frames with the same compliance both ways
    alike = {"frame_compliance"} if "pulley_radius" in names else set()
    return [
        Term(one.layout, np.full(2, one.vector[0])) if one.name in alike else one for one in drawn
    ]


def _wanted(names: Sequence[str], lacking: Mapping[str, str]) -> str:
    """What effects need that is lacking, in words; "" if nothing is."""
    needs = {need for name in names for need in effect_named(name).needs}
    return " and ".join(words for need, words in lacking.items() if need in needs)


def others(
    robot: Robot, random: Generator, hidden: Sequence[Term], lacking: Mapping[str, str]
) -> Iterator[Term]:
    """Effects in place of those that would not show, in an order of the seed's."""
    known = _known(robot)
    for k in random.permutation(len(known)):
        name = known[k]
        if not _wanted([name], lacking) and all(name != one.name for one in hidden):
            yield _with_numbers(layout_of(effect_named(name), robot), robot, random)


def _known(robot: Robot) -> list[str]:
    """Names of the effects that may be drawn."""
    without = {_OF_TENSIONS, *CONTAINED}
    without |= set() if _room_for_sheaves(robot) else {"pulley_radius"}
    return [name for name in TRUE_EFFECTS if name not in without]


def _drawn(robot: Robot, random: Generator, count: int | None, least: int) -> list[str]:
    known = _known(robot)
    if count is None:
        count = max(int(random.choice(len(_SHARES), p=_SHARES)), least)
    if count > len(known):
        raise CrosscheckError(f"{counted(count, 'effect')}: expected at most {len(known)}")
    return [known[i] for i in random.choice(len(known), size=count, replace=False)]


def _room_for_sheaves(robot: Robot) -> bool:
    """Whether all anchor points are well aside of their exit points, seen from above."""
    up = robot.up
    anchors = transform_points(robot.reference_pose[None], robot.anchor_points)[0]
    reach = anchors - robot.exit_points
    across = np.linalg.norm(reach - np.outer(reach @ up, up), axis=1)
    return bool(np.all(across > _ASIDE * np.linalg.norm(reach, axis=1)))


def _with_numbers(layout: Layout, robot: Robot, random: Generator) -> Term:
    many = int(np.sum(~layout.shape)) > 1
    size = random.uniform(*(_SEVERAL if many else _ONE), len(layout)) * layout.scale
    sign = random.choice([-1.0, 1.0], len(layout))
    one_sided = (layout.lower >= layout.null) | (layout.name in _UPWARDS)
    vector = layout.null + np.where(one_sided, 1.0, sign) * size
    # a size beyond the bounds changes its sign: a factor is never below a tenth
    low = np.maximum(layout.lower, np.where(layout.null > 0.0, 0.1 * layout.null, layout.lower))
    vector = np.where(vector < low, layout.null + size, vector)
    vector = np.minimum(vector, layout.upper)
    for k in np.flatnonzero(layout.shape):
        vector[k] = _shape(layout, int(k), robot, random)
    return Term(layout, vector)


def _shape(layout: Layout, k: int, robot: Robot, random: Generator) -> float:
    match layout.name, layout.names[k]:
        case "drum_eccentricity", "drum_radius_m":
            length = np.mean(robot.nominal_lengths(robot.reference_pose[None]))
            return float(length * random.uniform(0.04, 0.1))
        case "thermal_expansion", "zero_temperature_C":
            return 20.0
        case "hysteresis", "stretch_m":
            return float(layout.scale[k] * random.uniform(0.3, 2.0))
        case "creep", "time_s":
            return float(random.uniform(20.0, 200.0))
    return float(layout.null[k])


# What a twin hides, and the file that keeps it from being read by accident.
#
# The file is packed, not encrypted: neither a person who looks into the folder nor a command that
# searches it should learn what was hidden before they mean to.

NAME = "answer.sealed"
# Bytes of an unpacked answer: a thousand cables' worth of numbers.
_LARGEST = 10**6
_FIRST_LINE = "# What this twin hides. To see it: crosscheck twin --open"
_EXPECTED = f"expected a file {NAME} of crosscheck twin"


@dataclass(frozen=True)
class Moves:
    """Largest and rms change of the readings, relative to their noise."""

    max: float
    rms: float

    @classmethod
    def of(cls, truth: Truth, plain: Truth, sigma: Sigma, turns: NDArray[np.bool_]) -> Moves:
        """The change from the plain truth to another, at the rows where both are at rest.

        ``turns`` (3,) says about which axes the orientation is read.
        """
        rows = truth.at_rest & plain.at_rest
        a = np.concatenate([truth.position, truth.quat_wxyz], axis=1)[rows]
        b = np.concatenate([plain.position, plain.quat_wxyz], axis=1)[rows]
        assert sigma.position_m is not None and sigma.orientation_rad is not None
        change = pose_difference(a, b) / np.repeat([sigma.position_m, sigma.orientation_rad], 3)
        change = change[:, np.append(np.ones(3, dtype=bool), turns)]
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
            ValueError: the document is something else.
        """
        words: list[Any] = [document.get(key) for key in ("robot", "truth")]
        counts: list[Any] = [document.get(key) for key in ("seed", "poses")]
        values, moves = (_table(document.get(key)) for key in ("values", "moves_over_noise"))
        if (
            not all(isinstance(word, str) and word.isprintable() for word in words)
            or not all(type(count) is int and count >= 0 for count in counts)
            or values.keys() != moves.keys()
            or not all(map(str.isidentifier, values))  # an effect of one's own may be among them
        ):
            raise ValueError
        return cls(
            robot=words[0], truth=words[1], seed=counts[0], poses=counts[1],
            values={name: _numbers(one) for name, one in values.items()},
            moves_over_noise={name: Moves(**_numbers(one, _MOVES)) for name, one in moves.items()},
            all_move_over_noise=Moves(**_numbers(document.get("all_move_over_noise"), _MOVES)),
            sigma=_numbers(document.get("sigma")),
        )  # fmt: skip


_MOVES = {"max", "rms"}


def _table(given: object) -> dict[str, Any]:
    """A table, if it is one."""
    if not isinstance(given, dict):
        raise ValueError
    return given


def _numbers(given: object, keys: set[str] | None = None) -> dict[str, float]:
    """A table of finite numbers, with these keys if they are known."""
    table = _table(given)
    numbers = all(type(one) in (int, float) and math.isfinite(one) for one in table.values())
    if not numbers or not all(map(str.isprintable, table)) or keys not in (None, {*table}):
        raise ValueError
    return table


def seal(answer: Answer) -> str:
    """The text of a sealed file."""
    packed = zlib.compress(json.dumps(plain(answer)).encode("utf-8"), 9)
    lines = textwrap.wrap(base64.b64encode(packed).decode("ascii"), 76)
    return "\n".join([_FIRST_LINE, *lines]) + "\n"


def unseal(path: str | Path) -> Answer:
    """The answer in a sealed file, or in the case folder that holds one.

    Args:
        path: of the sealed file, or of its case folder.

    Returns:
        the hidden effects with their values.

    Raises:
        InputFileError: there is no such file, or it is not a sealed answer.
        InputError: no path.

    Example:
        ``crosscheck.unseal("case/answer.sealed").hidden``
    """
    path = path_of(path, "a sealed answer")
    file = path / NAME if path.is_dir() else path
    first, _, body = read_text(file, _EXPECTED).partition("\n")
    try:
        if first != _FIRST_LINE:
            raise ValueError
        opened = zlib.decompressobj()
        text = opened.decompress(base64.b64decode(body), _LARGEST)
        if not opened.eof:  # cut off, or larger: small files can unpack to any size
            raise ValueError
        return Answer.of_json(_table(json.loads(text)))
    except (ValueError, RecursionError, zlib.error, binascii.Error):
        raise InputFileError.at(file, f"is not a sealed answer; {_EXPECTED}") from None
