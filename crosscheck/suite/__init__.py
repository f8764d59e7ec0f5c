"""SEECR compared with MuJoCo, pose by pose: what `crosscheck run` does."""

from __future__ import annotations

from crosscheck.suite.cases import Case, select, shipped_cases, user_cases
from crosscheck.suite.chosen import GivenCase, every_shipped, shipped_like
from crosscheck.suite.effects import (
    EffectCase,
    EffectResult,
    effect_cases,
    shipped_effect_cases,
)
from crosscheck.suite.junit import junit_xml
from crosscheck.suite.outcome import Outcome
from crosscheck.suite.results import CaseResult
from crosscheck.suite.run import Run, results_json, run_suite
from crosscheck.suite.summary import summary_md
from crosscheck.suite.thresholds import Thresholds, load_thresholds, thresholds_toml
from crosscheck.suite.worst_pose import write_worst_pose

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
