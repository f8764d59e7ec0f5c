"""What a robot's file has that is read otherwise than written, or that keeps it from being read."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from seecr.errors import RobotError

# Elements that are named in one sentence; of a long list nobody reads all.
_MOST_NAMES = 8


def _elements(kind: str, names: list[str]) -> str:
    """Elements in words: ``tendon left``, or ``each of the bodies left and right``."""
    if len(names) == 1:
        return f"{kind} {names[0]}"
    many = f"{kind[:-1]}ies" if kind.endswith("y") else f"{kind}s"
    return f"each of the {many} {listed(names)}"


def listed(names: Iterable[str]) -> str:
    """Names in a sentence, the first few if there are many."""
    some = list(names)
    more = len(some) - _MOST_NAMES
    if more > 0:
        return f"{', '.join(some[:_MOST_NAMES])} and {more} more"
    return f"{', '.join(some[:-1])} and {some[-1]}" if len(some) > 1 else some[0]


@dataclass(frozen=True)
class Said:
    """A sentence about one element; ``{}`` in it is ``value``, which may differ by element.

    Without a ``kind`` of element the text stands alone, else it begins with a verb.
    """

    kind: str
    name: str
    text: str
    value: str = ""
    fixable: bool = True


@dataclass
class Findings:
    """Objections to a file and notes about it, each about an element, told once for all alike.

    Attributes:
        path: the file.
    """

    path: Path
    _objections: list[Said] = field(default_factory=list)
    _notes: list[Said] = field(default_factory=list)

    def refuse(
        self, kind: str, name: str, text: str, value: str = "", fixable: bool = False
    ) -> None:
        """Keep an objection: what is wrong with the element, and the remedy.

        Args:
            kind: of the element, such as ``tendon``; "" if the text stands alone.
            name: of the element. text: begins with a verb; ``{}`` is for ``value``.
            fixable: whether ``--fix`` can mend it.
        """
        self._objections.append(Said(kind, name, text, value, fixable))

    def note(self, kind: str, name: str, text: str, value: str = "") -> None:
        """Keep a note: what of the element is left out or taken for granted."""
        self._notes.append(Said(kind, name, text, value))

    @property
    def objections(self) -> tuple[str, ...]:
        """The objections as sentences."""
        return sentences(self._objections)

    @property
    def unfixable(self) -> tuple[str, ...]:
        """Those that ``--fix`` cannot mend."""
        return sentences([one for one in self._objections if not one.fixable])

    @property
    def notes(self) -> tuple[str, ...]:
        """The notes as sentences, each with the file."""
        return tuple(f"{self.path}: {text}" for text in sentences(self._notes))

    def check(self) -> None:
        """End if there are objections.

        Raises:
            RobotError: with all of them: one on the file's line, several on a line each.
        """
        some = self.objections
        if not some:
            return
        cure = "" if self.unfixable else "; --fix OUT.xml writes the robot without this"
        if len(some) == 1:
            raise RobotError(f"{self.path}: {some[0]}{cure}")
        head = f"{self.path}: {len(some)} objections{cure.replace('this', 'these')}:"
        raise RobotError("\n".join([head, *(f"  - {text}" for text in some)]))


def sentences(said: list[Said]) -> tuple[str, ...]:
    """One sentence for all elements of which the same is said."""
    groups: dict[tuple[str, str], list[Said]] = {}
    for one in said:
        groups.setdefault((one.kind, one.text), []).append(one)
    out = []
    for (kind, text), some in groups.items():
        values = listed(dict.fromkeys(one.value for one in some))
        names = list(dict.fromkeys(one.name for one in some))
        start = f"{_elements(kind, names)} " if kind else ""
        out.append(start + text.replace("{}", values))
    return tuple(out)
