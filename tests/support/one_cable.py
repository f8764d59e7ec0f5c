"""One cable alone: a row of the table, and what the compiled law says of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from seecr.compiled import columns
from seecr.compiled.cable import N_WORK, cable_pull
from seecr.compiled.cable_law import geometric_length
from seecr.compiled.columns import (
    EA,
    GAP,
    HYSTERESIS_STRETCH,
    N_COLUMNS,
    N_STATE,
    REST,
    TENSION,
)

UP = np.array([0.0, 0.0, 1.0])


@dataclass
class Pull:
    """What the compiled law says of one cable."""

    force: np.ndarray
    stiffness: np.ndarray
    slope: np.ndarray
    state: np.ndarray
    guess: np.ndarray
    ok: bool

    @property
    def tension(self) -> float:
        return float(self.state[TENSION])


def cable(**values: Any) -> np.ndarray:
    """A row of the table: E S = 1000 N, 2 m, from the origin of the base frame."""
    row = np.zeros(N_COLUMNS)
    row[EA], row[REST] = 1000.0, 2.0
    row[HYSTERESIS_STRETCH] = 1.0
    for name, value in values.items():
        row[getattr(columns, name)] = value
    return row


def pull(row: np.ndarray, anchor: Any, move: Any = (0.0, 0.0, 0.0)) -> Pull:
    """The law with the anchor at ``anchor`` + ``move``, the former being the command."""
    row, start = row.copy(), np.array(anchor, float)
    row[GAP] = geometric_length(row, start, UP) - row[REST]
    force, slope, guess = np.zeros(3), np.zeros(3), np.zeros(3)
    stiffness, state, work = np.zeros((3, 6)), np.zeros(N_STATE), np.zeros((N_WORK, 6))
    ok = cable_pull(
        row, start, np.array(move, float), UP, guess, work, force, stiffness, slope, state
    )
    return Pull(force, stiffness[:, :3], slope, state, guess, ok)


def in_direction(degrees_below: float, length: float, azimuth: float = 0.7) -> np.ndarray:
    below = np.deg2rad(degrees_below)
    flat = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    return length * (np.cos(below) * flat - np.sin(below) * UP)
