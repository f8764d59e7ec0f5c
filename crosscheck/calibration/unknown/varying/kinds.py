"""What an unknown effect may change, in words, and how to find out about it by hand."""

from __future__ import annotations

from enum import StrEnum

_MOVE = (
    "move the tracker and measure some poses again; an error that moves with it comes from the "
    "tracker"
)
_FREE = (
    "take hoses and leads off the platform, or hang them elsewhere, and measure some poses again; "
    "an error that changes comes from their pull"
)


class Varying(StrEnum):
    """What may change smoothly without being an effect, in words, and how to find out about it."""

    POSITION = "something that varies smoothly over the workspace, in the position alone", _MOVE
    ORIENTATION = (
        ("something that varies smoothly over the workspace, in the orientation alone"),
        _MOVE,
    )
    TENSION = (
        "something that varies smoothly over the workspace, in the tensions alone",
        "hang a known weight on each load cell, as it is mounted, at several angles of its cable",
    )
    READINGS = "something that varies smoothly over the workspace, in all readings", ""
    SESSION = (
        "something that varies smoothly over the session, in the position",
        "read a stationary target before, between and after the runs, and measure the first poses "
        "again at the end",
    )
    LAG = (
        "readings that lag behind the last step, as if the platform were still on its way",
        "wait longer after each step before reading, and come to some poses from the other side",
    )
    EXIT_POINTS_MOVE = (
        "exit points that move over the session",
        "survey the exit points before and after the runs, and measure the first poses again at "
        "the end",
    )
    LENGTHS_DRIFT = (
        "cable lengths that change over the session",
        "mark the cables where they leave the winches, see whether the marks come back to their "
        "places, and measure the first poses again at the end",
    )
    POSITION_BY_RUN = (
        "a position that is off by another amount in each run, as if the tracker had been moved",
        "read a stationary target before, between and after the runs",
    )
    LENGTHS_BY_RUN = (
        "cable lengths that are off by other amounts in each run, as if the robot were homed anew",
        "home the robot once for all runs, or measure the same pose at the start and at the end "
        "of each",
    )
    FORCE_DRIFTS = (
        "a force on the platform that changes over the session",
        "weigh the platform before and after the runs, and measure the first poses again at the "
        "end",
    )
    FORCE = "a force on the platform that changes with its position", _FREE
    SPRING = "something that pulls the platform like a spring", _FREE
    LENGTHS = (
        "cable lengths that change with the position",
        "measure what each winch pays out, at several lengths and with the other winches elsewhere",
    )
    WINCHES = (
        "lengths that change with how far the winches have turned, as with rope in layers",
        "measure what each winch pays out turn by turn, over all of its travel",
    )

    ONE_CABLE = (
        "the length of one cable that changes with the position, as over an edge",
        "see whether a cable touches anything on its way, on all sides of the workspace",
    )
    COUPLED = (
        "cable lengths that change with how far other winches have turned",
        "turn one winch at a time, and see whether any other cable moves",
    )

    advice: str

    def __new__(cls, word: str, advice: str) -> Varying:
        """Words with advice; the advice is "" if they name nothing that can be checked by hand."""
        varying = str.__new__(cls, word)
        varying._value_, varying.advice = word, advice
        return varying
