"""Chooses the poses that tell most, one after the other, each the best beside those before.

For an effect g and its imitator h, the signal that h cannot imitate is
tr(M_gg - M_gh M_hh^+ M_hg), with M the sum of J^T J over all readings (the T-criterion of model
discrimination). So a pose is tried by adding its own M.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.planning.visibility import Signal
from seecr.pose import Array

# Directions of M_hh (squares of columns) do not count if they are so much weaker than the best.
_RANK = 1e-10


@dataclass(frozen=True)
class Wanted:
    """An effect that readings do not show yet, or two effects that they do not tell apart.

    Attributes:
        effect: the effect that should show. other: the one to tell it from; "" if it should only be
            seen.
        now: squared signal so far. needed: squared signal that a test finds.
    """

    effect: str
    other: str
    now: float
    needed: float


def chosen_poses(
    own: Mapping[str, Signal],
    there: Mapping[str, Signal],
    row_of: NDArray[np.integer],
    pairs: Sequence[Wanted],
    most: int,
    sample: int | None = None,
) -> list[int]:
    """Rows of the candidate poses to add, the best first.

    Args:
        own: signals in the readings planned so far.
        there: signals of the same effects in the readings of all candidates.
        row_of: (N,) the candidate that each of those readings belongs to.
        pairs: what is not shown or told apart so far.
        most: most poses to choose.
        sample: how many candidates to try in each step, drawn anew; by default all. A sample is
            nearly as good and much faster (Mirzasoleiman et al. 2015, Lazier than lazy greedy).
    """
    if not pairs:
        return []
    names = list(own)
    part = _parts(own)
    whole = np.concatenate([own[n].columns for n in names], axis=1)
    added = np.concatenate([there[n].columns for n in names], axis=1)
    candidates = np.unique(row_of)
    grams = np.stack([_gram(added[row_of == k]) for k in candidates])
    total = _gram(whole)
    chosen: list[int] = []
    score = _scores(total[None], part, pairs)[0]
    random = np.random.default_rng(0)
    for _ in range(min(most, len(candidates))):
        # each pose once: measuring it again tells nothing new
        left = np.flatnonzero(~np.isin(candidates, chosen))
        if sample is not None and len(left) > sample:
            left = random.choice(left, sample, replace=False)
        scores = _scores(total[None] + grams[left], part, pairs)
        best = int(np.argmax(scores))
        if not scores[best] > score * (1.0 + 1e-6):
            break
        chosen.append(int(candidates[left[best]]))
        total, score = total + grams[left[best]], float(scores[best])
    return chosen


def _parts(own: Mapping[str, Signal]) -> dict[str, slice]:
    out, first = {}, 0
    for name, signal in own.items():
        out[name] = slice(first, first + signal.columns.shape[1])
        first += signal.columns.shape[1]
    return out


def _gram(columns: Array) -> Array:
    return np.asarray(columns.T @ columns)


def _scores(grams: Array, part: Mapping[str, slice], pairs: Sequence[Wanted]) -> Array:
    """Score of each candidate (k,): the sum over pairs of signal over needed, hardly beyond 1."""
    score = np.zeros(len(grams))
    inverse: dict[str, Array] = {}
    for want in pairs:
        g, other = part[want.effect], want.other
        signal = np.trace(grams[:, g, g], axis1=1, axis2=2)
        if other:
            h = part[other]
            if other not in inverse:
                inverse[other] = np.asarray(
                    np.linalg.pinv(grams[:, h, h], rcond=_RANK, hermitian=True), dtype=float
                )
            cross = grams[:, g, h]
            imitated = np.einsum("kgh,khi,kgi->k", cross, inverse[other], cross, optimize=True)
            signal = signal - imitated
        ratio = np.maximum(signal, 0.0) / want.needed
        score += np.minimum(ratio, 1.0) + 0.01 * np.log1p(ratio)
    return score
