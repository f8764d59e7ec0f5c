"""What measurements would show, before they are made."""

from __future__ import annotations

from crosscheck.planning.design import Plan, make_plan

__all__ = ["Plan", "make_plan"]
