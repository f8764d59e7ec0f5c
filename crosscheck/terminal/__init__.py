"""Results as text for people; nothing is computed here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from seecr.lazy import lazily

if TYPE_CHECKING:
    from crosscheck.terminal.addition import print_addition
    from crosscheck.terminal.calibration import print_calibration
    from crosscheck.terminal.comparison import print_comparison
    from crosscheck.terminal.diagnosis import print_diagnosis
    from crosscheck.terminal.effects import (
        effect_record,
        parameter_lines,
        print_effect,
        print_effects,
    )
    from crosscheck.terminal.plan import print_plan
    from crosscheck.terminal.suite import print_run

# Each imports what it prints: a command loads its own alone.
_WHERE = {
    "effect_record": "effects",
    "parameter_lines": "effects",
    "print_addition": "addition",
    "print_calibration": "calibration",
    "print_comparison": "comparison",
    "print_diagnosis": "diagnosis",
    "print_effect": "effects",
    "print_effects": "effects",
    "print_plan": "plan",
    "print_run": "suite",
}

__all__ = [
    "effect_record",
    "parameter_lines",
    "print_addition",
    "print_calibration",
    "print_comparison",
    "print_diagnosis",
    "print_effect",
    "print_effects",
    "print_plan",
    "print_run",
]

__getattr__ = lazily(__name__, _WHERE)
