"""The confusion map: what part of one effect's signal another could imitate on these data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.patches import Rectangle

from crosscheck.diagnosis.path import ModelPath
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.fit.least_squares.imitation import basis, beside, imitated
from crosscheck.fit.reasons import Why
from crosscheck.inference.catalogue import About
from crosscheck.report.drawing import BEFORE, INK, WIDTH, blank, image, styled
from seecr.pose import Array

# Effects in the map where some are listed, and where none are.
_FEW, _MANY = 12, 30
# From here on two effects look alike.
ALIKE = 0.9


@dataclass(frozen=True, eq=False)
class Confusion:
    """What could imitate what.

    Attributes:
        names: of the effects. listed: of those, how many the diagnosis lists (they come first).
        part: (k, k) part of the row's signal that the column could imitate.
    """

    names: tuple[str, ...]
    listed: int
    part: Array

    @property
    def twins(self) -> list[tuple[str, str]]:
        """Pairs that imitate each other."""
        k = len(self.names)
        return [
            (self.names[i], self.names[j])
            for i in range(k)
            for j in range(i + 1, k)
            if min(self.part[i, j], self.part[j, i]) > ALIKE
        ]


def confusion_of(found: Diagnosis) -> Confusion | None:
    """Of the effects found, their rivals and the best of the others, at the final model."""
    if found.path is None:
        return None
    columns, about = {}, found.path.search.every.about(found.path.last.fit)
    for name in _names(found):
        own = _columns(found.path, about, name)
        if own is not None and float(np.sum(own**2)) > 0.0:
            columns[name] = own
    kept = tuple(columns)
    if len(kept) < 2:
        return None
    bases = {name: basis(own) for name, own in columns.items()}
    part = np.array([[imitated(columns[a], bases[b]) for b in kept] for a in kept])
    listed = sum(1 for f in found.missing if f.effect in columns)
    return Confusion(kept, listed, part)


def _names(found: Diagnosis) -> list[str]:
    """Listed effects first, then what cannot be told from them, then the best of the others."""
    names = [f.effect for f in found.missing]
    names += [rival.name for f in found.missing for rival in f.rivals]
    names += [
        row.effect
        for row in sorted(found.candidates, key=lambda row: -row.score)
        if not row.why_not.lacking and row.why_not.why is not Why.UNSEEN
    ]
    return list(dict.fromkeys(names))[: _FEW if found.missing else _MANY]


def _columns(path: ModelPath, about: About, name: str) -> Array | None:
    """(N, p) what an effect does beside the base model, by plausible sizes."""
    final = path.last.fit
    key = path.search.every.keys_of(final.terms).get(name, name)
    own = about.columns.get(key)
    if own is None:
        return None
    had = np.array([effect in path.base for effect, _key in final.terms.labels], dtype=bool)
    return beside(own, basis(final.jacobian[:, had]))


def draw_confusion(confusion: Confusion) -> str:
    """A matrix: row imitated by column; pairs that imitate each other are framed."""
    names, part = confusion.names, confusion.part
    k = len(names)
    side = min(0.5, 7.2 / k)
    with styled():
        figure = blank(side * k + 1.75, min(WIDTH, side * k + 3.4))
        axes = figure.subplots()
        axes.imshow(part, cmap="Blues", vmin=0.0, vmax=1.25, aspect="equal")
        for i in range(k):
            for j in range(k):
                if i != j and part[i, j] >= 0.005:
                    axes.text(
                        j, i, _words(part[i, j], k), ha="center", va="center",
                        fontsize=7.5 if k <= _FEW else 6.2,
                        color="white" if part[i, j] > 0.75 else INK,
                    )  # fmt: skip
        for a, b in confusion.twins:
            for i, j in ((names.index(a), names.index(b)), (names.index(b), names.index(a))):
                corner = (j - 0.46, i - 0.46)
                axes.add_patch(
                    Rectangle(corner, 0.92, 0.92, fill=False, edgecolor=BEFORE, linewidth=1.8)
                )
        axes.set_xticks(range(k), names, rotation=40, ha="right", rotation_mode="anchor")
        axes.set_yticks(range(k), names)
        for label in axes.get_yticklabels()[: confusion.listed]:
            label.set_fontweight("bold")
        for label in axes.get_xticklabels()[: confusion.listed]:
            label.set_fontweight("bold")
        axes.set_xlabel("could be imitated by")
        axes.tick_params(length=0)
        for spine in axes.spines.values():
            spine.set_visible(False)
        return image(figure, "How much of each effect another could imitate")


def _words(part: float, count: int) -> str:
    if count > _FEW and part < 0.5:
        return ""
    text = f"{100 * np.floor(100 * part) / 100:.0f}"
    return text if part < 0.9995 else "100"
