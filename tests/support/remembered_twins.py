"""MuJoCo's answers remembered, for tests of what is done with twins that it measured before.

A twin that is measured along other commands has effects as large as along its sweeps, and MuJoCo is
asked for those each time. That is how it has to be for users, who may change a law of their own in
between.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import fields
from typing import Any

import pytest

from crosscheck.twin import lab
from crosscheck.twin.measure import Truth
from seecr.commands import Commands
from seecr.description.robot import Robot
from seecr.effects import Effect

_answers: dict[bytes, Truth] = {}
_measure = lab.measure


def remember_twins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let MuJoCo answer the same question once for all tests of a process."""
    monkeypatch.setattr(lab, "measure", _remembered)


def _remembered(
    robot: Robot,
    commands: Commands,
    effects: Sequence[Effect] = (),
    *,
    length_errors: Any = None,
    progress: Callable[[int], None] = lambda _rows: None,
) -> Truth:
    own = [getattr(robot, field.name) for field in fields(robot)]
    question = pickle.dumps((own, commands, list(effects), length_errors))
    key = hashlib.sha256(question).digest()
    if key not in _answers:
        _answers[key] = _measure(
            robot, commands, effects, length_errors=length_errors, progress=progress
        )
    return deepcopy(_answers[key])  # whoever gets it may write into it
