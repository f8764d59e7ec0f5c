"""Reasons as enums: the value of each is the sentence that people read, numbers are kept beside it.

Programs decide by the enum, never by the text, as with :class:`seecr.Status`.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from enum import Enum, StrEnum

from crosscheck.errors import CrosscheckError
from seecr.counted import counted


class Why(Enum):
    """Why an effect is no candidate or was not chosen; the values are what people read."""

    EXCLUDED = "not considered, as was asked for"
    TOO_MANY_PARAMETERS = "{parameters}, but the data have {rows}"
    NEEDS_POSES = "needs commanded poses, or lengths as told; these are absolute"
    NEEDS_TIME = "needs the time of each row (t_s)"
    NEEDS_TEMPERATURE = "needs temperature_C"
    CONSTANT_TEMPERATURE = "the temperature never changed"
    NEEDS_TENSIONS = "needs measured tensions"
    NOT_MOVED = "these commands do not move what it goes with"
    UNSEEN = "these data do not show it: no reading moves by its plausible size"
    IMPOSSIBLE = "would need what no robot can have"
    UNSOLVED = "no fit: rows could not be solved with it"
    CHANCE = "chance explains it (p {p:.2g})"
    CHANCE_OVER_ALL = "chance explains it (p {p:.2g} over all tried)"
    PROMISES_LESS = "promises less than others beside it"
    EXPLAINS_LITTLE = "explains too little for its {parameters}"
    NOT_PREDICTIVE = "does not predict runs left out any better"
    EXPLAINED_BETTER = "explained better by {by}"
    NOT_NEEDED = "not needed"
    ALIKE = "cannot be told from {by}, which is listed"
    NOT_NEEDED_BESIDE = "not needed beside {by} (probability {p:.2g})"
    CARRIES_LITTLE = "probable ({p:.2g}), but explains little beside {by}: not sure"
    NOT_SURE = "probable ({p:.2g}), but not sure"
    IMPROBABLE = "explains too little (probability {p:.2g})"
    IMITATES = "not sure: its {parameters} can imitate much of what no effect explains"
    MAY_IMITATE = "not sure: likelier it imitates what no effect explains"
    EXPLAINS_PART = "explains a part, but structure remains: not sure"


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
        p: p-value of what it explains, or a probability, see ``why``.
        by: effects that explain it better, or as well.
        beside: effects of the model beside which it was tried; empty for the model as it stood.
    """

    why: Why
    parameters: int = 0
    rows: int = 0
    p: float = 1.0
    by: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()

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
            p=min(1.0, self.p),
            by=", ".join(self.by),
        )

    def __str__(self) -> str:
        text = f"no candidate: {self.words}" if self.lacking else self.words
        return f"beside {', '.join(self.beside)}: {text}" if self.beside else text


class Unfit(Enum):
    """Why measurements are not fit for a verdict; the values are what people read."""

    NO_READINGS = "the data hold no readings"
    NO_EQUILIBRIUM = "at {lost} of {rows} there is no equilibrium to compare with; see the notes"
    FEW_READINGS = "only {readings} left"
    FEW_POSES = "only {poses} measured, counting a pause once: too few to tell effects"
    CONSTANT_COMMANDS = "all commands are the same: nothing tells effects apart"
    FROZEN_READINGS = "all readings are the same though the commands differ"
    CONTRADICTION = (
        "readings contradict each other: lines {lines} have the same command and are far apart, "
        "and they are not alone"
    )
    BLIND = "noise of {noise} would hide every effect, at ten times its plausible size too"
    NOTHING_TO_TRY = "these data can show none of the effects to consider: {lacking}"
    UNSOLVED_MODEL = "rows could not be solved with the model's values"
    STRUCTURE_OR_NOISE = (
        "structure remains, but in only {rows}, whose noise nobody stated, it may as well be noise "
        "that is correlated from row to row"
    )


_MORE_POSES = (
    "add poses spread over the workspace, tilted ones too, in three runs or more; crosscheck plan "
    "says which show most"
)
_REMEDIES = {
    Unfit.NO_READINGS: "add readings: positions, angles or tensions of each pose",
    Unfit.NO_EQUILIBRIUM: "check the commands of the rows named in the notes, and the robot's file",
    Unfit.FEW_READINGS: _MORE_POSES,
    Unfit.FEW_POSES: _MORE_POSES,
    Unfit.CONSTANT_COMMANDS: _MORE_POSES,
    Unfit.FROZEN_READINGS: "check that the tracker followed the platform, and read the poses again",
    Unfit.CONTRADICTION: "read these poses again, leave out the wrong rows, or, where the tracker "
    "or the winches were set up anew in between, give each set-up a file of its own and "
    "crosscheck add tracker_frame (or another effect) --per file",
    Unfit.BLIND: "state the noise as it is, in metres and radians ([sigma] beside the file, or "
    "--sigma position=0.1mm), or measure with less",
    Unfit.NOTHING_TO_TRY: "record what they need, or let other effects be considered",
    Unfit.UNSOLVED_MODEL: "check the model's values and the robot's file",
    Unfit.STRUCTURE_OR_NOISE: "state the noise ([sigma] beside the file, or --sigma "
    "position=0.1mm): stay at one pose and read it for as long as the measurements took; or read "
    "more poses, some of them twice",
}


@dataclass(frozen=True)
class Refusal:
    """Why nothing can be said about some measurements.

    Attributes:
        unfit: the kind of reason.
        rows: number of rows of the data, or of poses if these are too few.
        lost: how many have no equilibrium. readings: how many readings are left.
        lines: lines of the file that show it. noise: noise of the readings, with units.
        lacking: effects, and what the data lack for each.
    """

    unfit: Unfit
    rows: int = 0
    lost: int = 0
    readings: int = 0
    lines: str = ""
    noise: str = ""
    lacking: str = ""

    @property
    def remedy(self) -> str:
        """What to do about it, as a sentence."""
        return _REMEDIES[self.unfit]

    @property
    def unsolved(self) -> bool:
        """Whether it is solutions of the statics that are lacking, not data."""
        if self.unfit is Unfit.FEW_READINGS:
            return self.readings == 0
        return self.unfit in (Unfit.NO_EQUILIBRIUM, Unfit.UNSOLVED_MODEL)

    def __str__(self) -> str:
        return self.unfit.value.format(
            rows=counted(self.rows, "row"),
            poses=counted(self.rows, "pose"),
            lost=self.lost,
            readings=counted(self.readings, "reading"),
            lines=self.lines,
            noise=self.noise,
            lacking=self.lacking,
        )


class DiagnosisVerdict(StrEnum):
    """The verdict of a diagnosis, in the words of ``diagnosis.json``."""

    NO_EFFECT_MISSING = "no_effect_missing", "model and data agree"
    EFFECTS_FOUND = "effects_found", "what is left after them is noise"
    MANY_EFFECTS = "many_effects", "no few effects explain the error, all together do"
    UNKNOWN_EFFECT = "unknown_effect", "structure remains that no known effect explains"
    NO_VERDICT = "no_verdict", "the data or the solves are not fit for one"

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
        raise CrosscheckError(f"no verdict {word!r}; there are, nearest first: {', '.join(near)}")

    @property
    def heading(self) -> str:
        """The verdict as a heading."""
        return self.value.replace("_", " ").capitalize()
