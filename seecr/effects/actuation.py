"""What length was really paid out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from seecr.commands import Commands
from seecr.description.robot import Robot
from seecr.effects.base import Effect, Total, mean_length, of_length, parameter
from seecr.effects.setup import Setup
from seecr.pose import Array, moved_by

# Largest radius of a drum, as a part of the mean cable length. Drums of a quarter of it, which turn
# half a turn in the data, imitated a platform that bends.
_LARGEST = 0.12


# Of so many rows at most, the waves of drums are kept: four times as many fill 50 MB.
_FEW_ROWS = 100_000


@dataclass(frozen=True, eq=False)
class CableLengthOffset(Effect):
    """Each cable is longer than commanded by a constant: l0_i += offset_i.

    The zero of the winch was set wrong. Positive: more cable than commanded.
    """

    name: ClassVar[str] = "cable_length_offset"
    anew: ClassVar[tuple[str, ...]] = ("file", "run")
    place: ClassVar[str] = "actuation"
    title: ClassVar[str] = "constant error of each cable's length"
    advice: ClassVar[str] = (
        "measure each cable at the reference pose with a tape: expect the offsets found, the "
        "largest {largest:+.1f} mm ({which}: {total:.1f} mm paid out, not {total_nominal:.1f})"
    )

    offset: Array = parameter("m", of_length(2e-3), size="cable")

    def edit_setup(self, setup: Setup) -> None:
        setup.extra_length = setup.extra_length + self.offset

    def totals(self, robot: Robot) -> dict[str, Total]:
        return {
            f"offset_{i + 1}_m": Total(float(length + off), float(length), "m", lower=0.0)
            for i, (length, off) in enumerate(zip(robot.rest_lengths, self.offset, strict=True))
        }


@dataclass(frozen=True, eq=False)
class InitialPoseError(Effect):
    """The platform was misplaced when the winches were zeroed.

    The zero of every cable is its length at the pose where the platform really was,
    reference pose + (position, rotation): what the paper blames for its remaining
    error (section IV). l0_i = L_i(true zero) + commanded change, L_i the geometric length.
    Displacement and rotation vector in the base frame, true less assumed.
    """

    name: ClassVar[str] = "initial_pose_error"
    anew: ClassVar[tuple[str, ...]] = ("file", "run")
    place: ClassVar[str] = "actuation"
    title: ClassVar[str] = "platform misplaced when the winches were zeroed"
    needs: ClassVar[tuple[str, ...]] = ("poses",)
    advice: ClassVar[str] = (
        "measure the platform with the tracker at the reference pose before releasing it"
    )

    position: Array = parameter("m", of_length(4e-3), size="vector")
    rotation: Array = parameter("rad", 0.01, size="vector")

    def edit_setup(self, setup: Setup) -> None:
        change = np.concatenate([self.position, self.rotation])
        if np.any(change):
            setup.zero_pose = moved_by(setup.zero_pose, change)


@dataclass(frozen=True, eq=False)
class DrumGain(Effect):
    """Winch i pays out more or less than commanded: change_i -> (1 + gain_i) change_i.

    Of the commanded change since the zero; of the whole length where absolute lengths are
    commanded. Positive: the drum is larger than assumed.
    """

    name: ClassVar[str] = "drum_gain"
    place: ClassVar[str] = "actuation"
    title: ClassVar[str] = "drums larger or smaller than assumed"
    parent: ClassVar[str] = "length_scale"
    advice: ClassVar[str] = (
        "measure each drum with a caliper: expect its diameter to be off by its gain, the largest "
        "{largest:+.4f} ({which})"
    )

    gain: Array = parameter("", 5e-3, size="cable", bounds=(-0.5, 1.0))

    def edit_setup(self, setup: Setup) -> None:
        setup.length_gain = setup.length_gain + self.gain


@dataclass(frozen=True, eq=False)
class LengthScale(Effect):
    """All winches pay out too much by one factor: change_i -> (1 + factor) change_i.

    Drums of one lot that are all larger than assumed, a gear ratio, or a cable thickness that was
    left out. Contained in the gains of the drums, with one number. Positive: more cable.
    """

    name: ClassVar[str] = "length_scale"
    place: ClassVar[str] = "actuation"
    title: ClassVar[str] = "all drums larger or smaller by the same factor"
    advice: ClassVar[str] = (
        "pay out ten turns of a drum along a tape: expect the length to be off by {factor:+.4f} "
        "of itself"
    )

    factor: float = parameter("", 0.01, bounds=(-0.5, 1.0))

    def edit_setup(self, setup: Setup) -> None:
        setup.length_gain = setup.length_gain + self.factor


@dataclass(frozen=True, eq=False)
class DrumEccentricity(Effect):
    """An eccentric drum adds a sine of its angle to the paid-out length.

    l0_i += sine_i sin(a) + cosine_i (cos(a) - 1), a = (commanded change)/radius; zero at the
    zero of the winch. Radii up to 12 % of the mean cable length are considered: a larger drum turns
    so little that its sine imitates whatever varies smoothly with a cable's length.
    """

    name: ClassVar[str] = "drum_eccentricity"
    place: ClassVar[str] = "actuation"
    title: ClassVar[str] = "eccentric drums"
    advice: ClassVar[str] = (
        "hold a dial gauge to each drum and turn it: expect the run-out found, the largest "
        "{largest:+.2f} mm ({which})"
    )

    sine: Array = parameter("m", of_length(1e-3), size="cable")
    cosine: Array = parameter("m", of_length(1e-3), size="cable")
    drum_radius: float = parameter(
        "m", of_length(0.05), null=0.05, bounds=(of_length(1e-3), of_length(_LARGEST)), shape=True
    )

    def edit_setup(self, setup: Setup) -> None:
        if not (np.any(self.sine) or np.any(self.cosine)):
            return
        waves = _kept_waves if len(setup.commands) <= _FEW_ROWS else _waves
        sine, cosine = waves(setup.commands, setup.robot, self.drum_radius)
        if np.any(self.sine):
            setup.extra_length = setup.extra_length + self.sine * sine
        if np.any(self.cosine):
            setup.extra_length = setup.extra_length + self.cosine * cosine

    @classmethod
    def shapes(cls, setup: Setup) -> list[dict[str, float]]:
        change = setup.commanded_change
        travel = float(np.max(np.ptp(change, axis=0)))
        if not travel > 0:
            return []
        # from half a turn over the whole travel to 40; a start is right to a seventh of a turn
        turns = np.arange(0.6, 40.0, 0.3)
        largest = _LARGEST * mean_length(setup.robot)
        radii = travel / (2 * np.pi * turns)
        return [{"drum_radius": float(r)} for r in radii[radii < largest]]


def _waves(commands: Commands, robot: Robot, radius: float) -> tuple[Array, Array]:
    """Sine and cosine (n, m) of the drums' angles, the cosine less that at the winches' zero.

    They take as long as what follows them, and many parameters are shifted with the same radius.
    """
    angle = commands.change(robot) / radius
    return np.sin(angle), np.cos(angle) - (0.0 if commands.absolute else 1.0)


_kept_waves = lru_cache(maxsize=4)(_waves)


@dataclass(frozen=True, eq=False)
class Backlash(Effect):
    """A winch turns ``gap`` of cable before the drum follows, whenever it reverses.

    The paid-out length p lags the commanded change c by at most half the gap:
    p <- min(max(p, c - gap/2), c + gap/2), the play operator (Krasnosel'skii and Pokrovskii,
    Systems with Hysteresis, 1989). It starts centred, p = c, at the reference pose, where each
    run starts, and follows c all along the straight way from row to row.
    """

    name: ClassVar[str] = "backlash"
    place: ClassVar[str] = "actuation"
    title: ClassVar[str] = "play between motor and drum"
    advice: ClassVar[str] = "hold each drum and rock its motor: expect {gap:.2f} mm of cable play"

    gap: float = parameter("m", of_length(2e-3), bounds=(0.0, 1e3))

    def edit_setup(self, setup: Setup) -> None:
        setup.backlash = setup.backlash + self.gap


@dataclass(frozen=True, eq=False)
class ThermalExpansion(Effect):
    """Cables expand with temperature: l0_i -> l0_i (1 + expansion (T - zero_temperature)).

    ``zero_temperature`` is that at which the winches were zeroed. Positive: longer when warm;
    aramids and other drawn fibres are negative.
    """

    name: ClassVar[str] = "thermal_expansion"
    place: ClassVar[str] = "actuation"
    title: ClassVar[str] = "cables that expand with temperature"
    needs: ClassVar[tuple[str, ...]] = ("temperature",)
    advice: ClassVar[str] = "repeat one pose at two temperatures and compare the platform's height"

    expansion: float = parameter("1_per_K", 5e-5)
    zero_temperature: float = parameter("C", 5.0, null=20.0, bounds=(-40.0, 60.0), shape=True)

    def edit_setup(self, setup: Setup) -> None:
        if self.expansion == 0.0 or setup.commands.temperature is None:
            return
        warmer = setup.commands.temperature - self.zero_temperature
        setup.length_factor = setup.length_factor * (1.0 + self.expansion * warmer)[:, None]

    @classmethod
    def shapes(cls, setup: Setup) -> list[dict[str, float]]:
        temperature = setup.commands.temperature
        if temperature is None or np.ptp(temperature) == 0:
            return []
        starts = (float(temperature[0]), 20.0, float(np.mean(temperature)))
        return [{"zero_temperature": t} for t in starts]
