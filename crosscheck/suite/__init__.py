"""SEECR compared with MuJoCo, pose by pose: what `crosscheck run` does."""

from __future__ import annotations

from crosscheck.suite.agreement import Thresholds, load_thresholds, thresholds_toml
from crosscheck.suite.cases import Case, select, shipped_cases, user_cases
from crosscheck.suite.effects import (
    EffectCase,
    EffectResult,
    effect_cases,
    shipped_effect_cases,
)
from crosscheck.suite.results import CaseResult
from crosscheck.suite.run import (
    GivenCase,
    Run,
    every_shipped,
    results_json,
    run_suite,
    shipped_like,
)
from crosscheck.suite.verdicts import Outcome
from crosscheck.suite.write import junit_xml, summary_md, write_worst_pose

__all__ = [
    "Case",
    "CaseResult",
    "EffectCase",
    "EffectResult",
    "GivenCase",
    "Outcome",
    "Run",
    "Thresholds",
    "effect_cases",
    "every_shipped",
    "junit_xml",
    "load_thresholds",
    "results_json",
    "run_suite",
    "select",
    "shipped_cases",
    "shipped_effect_cases",
    "shipped_like",
    "summary_md",
    "thresholds_toml",
    "user_cases",
    "write_worst_pose",
]
