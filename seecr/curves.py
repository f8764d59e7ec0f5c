"""Curves that coincide are drawn once, with all names: one would hide the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seecr.pose import Array

# Curves closer to each other than this part of the largest value coincide.
_ALIKE = 1e-6


def alike(curves: Sequence[Array]) -> list[list[int]]:
    """Groups of indices of curves that coincide on all timelines.

    Args:
        curves: (n, k) for each timeline.
    """
    whole = np.concatenate([np.asarray(values, float) for values in curves])
    near = _ALIKE * float(np.nanmax(np.abs(whole), initial=0.0))
    groups: list[list[int]] = []
    for k in range(whole.shape[1]):
        for group in groups:
            if np.allclose(whole[:, group[0]], whole[:, k], 0.0, near, equal_nan=True):
                group.append(k)
                break
        else:
            groups.append([k])
    return groups


def joined(names: Sequence[str]) -> str:
    """Several names as one, with a common beginning only once, as in "cable1, 2"."""
    first, *others = names
    stem = first.rstrip("0123456789")
    same = stem and all(
        name.startswith(stem) and name[len(stem) :].isdigit() for name in (first, *others)
    )
    return ", ".join([first, *(name[len(stem) :] if same else name for name in others)])
