"""Check the statics of a cable robot against MuJoCo and against measurements.

import crosscheck
found = crosscheck.diagnose("robot.xml", "measured.csv")
print(found)

Robots, measurements and models are given as paths or as what was read from them. Every result
prints as a few lines, shows itself in a notebook, and gives a data frame with ``to_frame()``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from seecr import __version__ as __version__
from seecr.lazy import lazily

if TYPE_CHECKING:
    from crosscheck.add import Addition, add_effect, add_effects
    from crosscheck.calibration.result import Calibrated, calibrate
    from crosscheck.comparison.limits import Limits, exceeded, load_limits
    from crosscheck.comparison.residuals import compare
    from crosscheck.comparison.result import Comparison
    from crosscheck.diagnosis.result import Diagnosis, MissingEffect
    from crosscheck.diagnosis.verdict import diagnose
    from crosscheck.errors import CrosscheckError, UnsolvedError
    from crosscheck.fit.noise.tolerance import Tolerance
    from crosscheck.fit.reasons import DiagnosisVerdict
    from crosscheck.importing.case import Imported, import_case
    from crosscheck.importing.choices import ImportChoices
    from crosscheck.measurements.data import Measurements, Sigma
    from crosscheck.measurements.read import load_commands, load_measurements
    from crosscheck.measurements.write import write_measurements
    from crosscheck.model.diagnosed import load_diagnosed
    from crosscheck.model.write import save_model
    from crosscheck.planning.choosing import choose_poses
    from crosscheck.planning.design import make_plan
    from crosscheck.planning.result import Plan
    from crosscheck.planning.write import write_plan
    from crosscheck.suite.cases import Case, shipped_cases, user_cases
    from crosscheck.suite.results import CaseResult
    from crosscheck.suite.run import Run, run_suite
    from crosscheck.suite.thresholds import Thresholds, load_thresholds
    from crosscheck.suite.write import write_run
    from crosscheck.twin.answer import unseal
    from crosscheck.twin.make import Twin, make_twin

# Imported when first used: SciPy, MuJoCo and the compiled loop take a while to load.
_WHERE = {
    "Addition": "add",
    "Calibrated": "calibration.result",
    "Case": "suite.cases",
    "CaseResult": "suite.results",
    "Comparison": "comparison.result",
    "CrosscheckError": "errors",
    "Diagnosis": "diagnosis.result",
    "DiagnosisVerdict": "fit.reasons",
    "ImportChoices": "importing.choices",
    "Imported": "importing.case",
    "Limits": "comparison.limits",
    "Measurements": "measurements.data",
    "MissingEffect": "diagnosis.result",
    "Plan": "planning.result",
    "Run": "suite.run",
    "Sigma": "measurements.data",
    "Thresholds": "suite.thresholds",
    "Tolerance": "fit.noise.tolerance",
    "Twin": "twin.make",
    "UnsolvedError": "errors",
    "add_effect": "add",
    "add_effects": "add",
    "calibrate": "calibration.result",
    "choose_poses": "planning.choosing",
    "compare": "comparison.residuals",
    "diagnose": "diagnosis.verdict",
    "exceeded": "comparison.limits",
    "import_case": "importing.case",
    "load_commands": "measurements.read",
    "load_diagnosed": "model.diagnosed",
    "load_limits": "comparison.limits",
    "load_measurements": "measurements.read",
    "load_thresholds": "suite.thresholds",
    "make_plan": "planning.design",
    "make_twin": "twin.make",
    "run_suite": "suite.run",
    "save_model": "model.write",
    "shipped_cases": "suite.cases",
    "unseal": "twin.answer",
    "user_cases": "suite.cases",
    "write_measurements": "measurements.write",
    "write_plan": "planning.write",
    "write_run": "suite.write",
}

__all__ = [
    "Addition",
    "Calibrated",
    "Case",
    "CaseResult",
    "Comparison",
    "CrosscheckError",
    "Diagnosis",
    "DiagnosisVerdict",
    "ImportChoices",
    "Imported",
    "Limits",
    "Measurements",
    "MissingEffect",
    "Plan",
    "Run",
    "Sigma",
    "Thresholds",
    "Tolerance",
    "Twin",
    "UnsolvedError",
    "add_effect",
    "add_effects",
    "calibrate",
    "choose_poses",
    "compare",
    "diagnose",
    "exceeded",
    "import_case",
    "load_commands",
    "load_diagnosed",
    "load_limits",
    "load_measurements",
    "load_thresholds",
    "make_plan",
    "make_twin",
    "run_suite",
    "save_model",
    "shipped_cases",
    "unseal",
    "user_cases",
    "write_measurements",
    "write_plan",
    "write_run",
]

__getattr__ = lazily(__name__, _WHERE)


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
