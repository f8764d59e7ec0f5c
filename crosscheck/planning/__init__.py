"""What measurements would show, before they are made."""

from __future__ import annotations

from crosscheck.planning.design import make_plan
from crosscheck.planning.result import Plan

__all__ = ["Plan", "make_plan"]
