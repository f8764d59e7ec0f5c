"""Predicts what measurements would show before they are made."""

from __future__ import annotations

from crosscheck.planning.design import choose_poses, make_plan
from crosscheck.planning.result import Plan
from crosscheck.planning.write import write_plan

__all__ = ["Plan", "choose_poses", "make_plan", "write_plan"]
