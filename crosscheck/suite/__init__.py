"""SEECR held against MuJoCo, pose by pose: what `crosscheck run` does."""

from __future__ import annotations

from crosscheck.suite.cases import Case, select, shipped_cases, user_cases
from crosscheck.suite.effects import (
    GROUP,
    PREFIX,
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
    "GROUP",
    "PREFIX",
    "Case",
    "CaseResult",
    "EffectCase",
    "EffectResult",
    "Outcome",
    "Run",
    "Thresholds",
    "effect_cases",
    "junit_xml",
    "load_thresholds",
    "results_json",
    "run_suite",
    "select",
    "shipped_cases",
    "shipped_effect_cases",
    "summary_md",
    "thresholds_toml",
    "user_cases",
    "write_worst_pose",
]
