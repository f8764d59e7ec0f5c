"""Reasons as enums: the value of each is the sentence that people read, numbers are kept beside it.

Programs decide by the enum, never by the text, as with :class:`seecr.Status`.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, StrEnum

from crosscheck.errors import CrosscheckError, UnsolvedError
from seecr.counted import counted


def probability_words(probability: float) -> str:
    """A probability as people read it."""
    if probability > 0.99:
        return "> 99 %"
    return "< 1 %" if probability < 0.01 else f"{100.0 * probability:.0f} %"


class Why(Enum):
    """Why an effect is no candidate or was not chosen; the values are what people read."""

    EXCLUDED = "excluded, as requested"
    TOO_MANY_PARAMETERS = "has {parameters}, but the data have only {rows}"
    NEEDS_POSES = "needs commanded poses or told lengths; these lengths are absolute"
    NEEDS_TIME = "needs the time of each row, column t_s"
    NEEDS_TEMPERATURE = "needs the temperature, column temperature_C"
    CONSTANT_TEMPERATURE = "the temperature never changed"
    NEEDS_TENSIONS = "needs measured tensions"
    NOT_MOVED = "these commands do not vary the quantity that it depends on"
    UNSEEN = "not visible in these data: its expected size moves no reading"
    GAINS_NOTHING = "explains nothing beside the others"
    ALIKE = "indistinguishable from {by}, which is listed"
    NOT_NEEDED_BESIDE = "not needed once {by} {are} in the model (probability {chance})"
    CARRIES_LITTLE = "probable ({chance}), but it explains little once {by} {are} in the model"
    NOT_SURE = "probable ({chance}) but not certain"
    IMPROBABLE = "explains too little (probability {chance})"
    MAY_IMITATE = "not certain: it may imitate an unknown effect"


_LACKING = {
    Why.EXCLUDED,
    Why.TOO_MANY_PARAMETERS,
    Why.NEEDS_POSES,
    Why.NEEDS_TIME,
    Why.NEEDS_TEMPERATURE,
    Why.CONSTANT_TEMPERATURE,
    Why.NEEDS_TENSIONS,
}


@dataclass(frozen=True)
class Reason:
    """Why an effect is not listed.

    Attributes:
        why: the kind of reason.
        parameters: number of parameters of the effect. rows: number of rows of the data.
        p: its probability. by: effects that explain as much.
    """

    why: Why
    parameters: int = 0
    rows: int = 0
    p: float = 1.0
    by: tuple[str, ...] = ()

    @property
    def lacking(self) -> bool:
        """Whether the data lack what the effect needs, so that it is no candidate at all."""
        return self.why in _LACKING

    @property
    def words(self) -> str:
        """The reason alone, as a sentence."""
        return self.why.value.format(
            parameters=counted(self.parameters, "parameter"),
            rows=counted(self.rows, "row"),
            chance=probability_words(self.p),
            by=", ".join(self.by),
            are="is" if len(self.by) == 1 else "are",
        )

    def __str__(self) -> str:
        return f"not a candidate: {self.words}" if self.lacking else self.words


def by_reason(reasons: Mapping[str, Reason]) -> list[str]:
    """Effects grouped by why they are left out, without those that the user excluded."""
    words: dict[str, list[str]] = {}
    for name, why in reasons.items():
        if why.why is not Why.EXCLUDED:
            words.setdefault(why.words, []).append(name)
    return [f"{', '.join(names)} ({why})" for why, names in words.items()]


_MORE_POSES = (
    "add poses spread over the workspace, some of them tilted, in three runs or more; crosscheck "
    "plan says which poses reveal most"
)


class Unfit(Enum):
    """Why measurements are not fit for a verdict, as people read it, and what to do about it."""

    NO_READINGS = (
        "the data contain no readings",
        "add readings of each pose: positions, angles or tensions",
    )
    NO_EQUILIBRIUM = (
        "the model has no equilibrium at {lost} of {rows}; see the notes",
        "check the robot's file and the commands of the rows named in the notes",
    )
    FEW_READINGS = (
        "only {readings} can be used",
        _MORE_POSES,
    )
    FEW_POSES = (
        "only {poses} measured (repeated readings at rest count once): too few to tell effects "
        "apart",
        _MORE_POSES,
    )
    CONSTANT_COMMANDS = (
        "all commands are the same, so effects cannot be told apart",
        _MORE_POSES,
    )
    FROZEN_READINGS = (
        "all readings are the same although the commands differ",
        "check that the tracker followed the platform, and read the poses again",
    )
    LOCKED_READINGS = (
        "the robot's joints lock all parts of the pose that were read",
        "read parts of the pose that change with the commands, or tensions",
    )
    CONTRADICTION = (
        "readings contradict each other: lines {lines} have the same command but readings far "
        "apart, and so do others",
        "measure these poses again or remove the wrong rows; if the tracker or the winches were "
        "set up anew in between, put each set-up into a file of its own and use crosscheck add "
        "tracker_frame (or another effect) --per file",
    )
    OTHER_CONVENTION = (
        "the measured orientations{file} are {off} from those that the model expects, and only "
        "{left} if {convention}: they seem to be written by another convention",
        "write how the platform is turned as seen from the base: quaternions with the scalar "
        "first (meas_qw meas_qx meas_qy meas_qz), or angles with R = Rx(rx) Ry(ry) Rz(rz)",
    )
    BLIND = (
        "noise of {noise} would hide every effect, even at ten times its expected size",
        "check the stated noise and its units ([sigma] in the TOML beside the file is in metres "
        "and radians; or use --sigma position=0.1mm), or measure with less noise",
    )
    NOTHING_TO_TRY = (
        "none of the effects considered is visible in these data: {lacking}",
        "record what they need, or consider other effects",
    )
    UNSOLVED_MODEL = (
        "some rows could not be solved with the model's values",
        "check the model's values and the robot's file",
    )
    STRUCTURE_OR_NOISE = (
        "a pattern remains, but with only {rows} and no stated noise it may as well be noise "
        "that is correlated from row to row",
        "state the noise ([sigma] beside the file, or --sigma position=0.1mm): stay at one pose "
        "and read it for as long as the measurements took; or read more poses, some of them "
        "twice",
    )

    remedy: str

    def __new__(cls, why: str, remedy: str) -> Unfit:
        """A reason with its remedy."""
        unfit = object.__new__(cls)
        unfit._value_, unfit.remedy = why, remedy
        return unfit


@dataclass(frozen=True)
class Refusal:
    """Why nothing can be said about some measurements.

    Attributes:
        unfit: the kind of reason.
        rows: number of rows of the data, or of poses if these are too few.
        lost: how many have no equilibrium. readings: how many readings are left.
        lines: lines of the file that show it. noise: noise of the readings, with units.
        lacking: effects, and what the data lack for each.
        off, left: distances, with units, of orientations from those expected, as they stand and by
            another convention. convention: which one. file: " of " and their file, of several.
    """

    unfit: Unfit
    rows: int = 0
    lost: int = 0
    readings: int = 0
    lines: str = ""
    noise: str = ""
    lacking: str = ""
    off: str = ""
    left: str = ""
    convention: str = ""
    file: str = ""

    @property
    def remedy(self) -> str:
        """What to do about it, as a sentence."""
        return self.unfit.remedy

    @property
    def unsolved(self) -> bool:
        """Whether it is solutions of the statics that are lacking, not data."""
        if self.unfit is Unfit.FEW_READINGS:
            return self.readings == 0
        return self.unfit in (Unfit.NO_EQUILIBRIUM, Unfit.UNSOLVED_MODEL)

    def error(self, path: object, what: str) -> CrosscheckError:
        """The error of a command that cannot go on with a file, and ``what`` it did not do."""
        kind = UnsolvedError if self.unsolved else CrosscheckError
        return kind(f"{path}: {self}; {what}: {self.remedy}")

    def __str__(self) -> str:
        rows, poses = counted(self.rows, "row"), counted(self.rows, "pose")
        readings = counted(self.readings, "reading")
        some = {**vars(self), "rows": rows, "poses": poses, "readings": readings}
        return str(self.unfit.value).format(**some)


class DiagnosisVerdict(StrEnum):
    """The verdict of a diagnosis, in the words of ``diagnosis.json``."""

    NO_EFFECT_MISSING = "no_effect_missing", "model and data agree"
    EFFECTS_FOUND = "effects_found", "with these effects the residuals are noise"
    MANY_EFFECTS = "many_effects", "no few effects explain the error, but all together do"
    UNKNOWN_EFFECT = "unknown_effect", "a pattern remains that no known effect explains"
    NO_VERDICT = "no_verdict", "the data or the solves do not allow one"

    meaning: str

    def __new__(cls, word: str, meaning: str) -> DiagnosisVerdict:
        """A verdict with the sentence that says what it means."""
        verdict = str.__new__(cls, word)
        verdict._value_, verdict.meaning = word, meaning
        return verdict

    @classmethod
    def named(cls, word: str) -> DiagnosisVerdict:
        """The verdict of that name.

        Raises:
            CrosscheckError: there is no such verdict; the message lists all, the nearest first.
        """
        by_word = {verdict.value: verdict for verdict in cls}
        if word in by_word:
            return by_word[word]
        every = list(by_word)
        near = difflib.get_close_matches(word, every, n=len(every), cutoff=0.0)
        raise CrosscheckError(
            f"no verdict {word!r}; expected one of, nearest first: {', '.join(near)}"
        )

    @property
    def heading(self) -> str:
        """The verdict as a heading."""
        return self.value.replace("_", " ").capitalize()
