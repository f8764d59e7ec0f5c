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
from seecr.lazy import lazily, pictured

if TYPE_CHECKING:
    from crosscheck.add import Addition, add_effect, add_effects
    from crosscheck.calibration import Calibrated, calibrate
    from crosscheck.comparison.limits import Limits, exceeded, load_limits
    from crosscheck.comparison.models import ComparedValue, ModelComparison, compare_models
    from crosscheck.comparison.residuals import compare
    from crosscheck.comparison.result import Comparison
    from crosscheck.controlled.control import Timing, control_in_time
    from crosscheck.controlled.machine import Winches
    from crosscheck.controlled.result import TimedControl
    from crosscheck.diagnosis.diagnose import diagnose
    from crosscheck.diagnosis.result import Diagnosis, MissingEffect, Tolerance
    from crosscheck.errors import CrosscheckError, UnsolvedError
    from crosscheck.fit.reasons import DiagnosisVerdict
    from crosscheck.importing.case import Imported, import_case
    from crosscheck.importing.choices import ImportChoices
    from crosscheck.measurements.arrays import Measurements
    from crosscheck.measurements.data import Sigma
    from crosscheck.measurements.read import load_commands, load_measurements
    from crosscheck.measurements.write import write_measurements
    from crosscheck.model.fitted import load_diagnosed
    from crosscheck.model.write import save_model
    from crosscheck.planning.design import choose_poses, make_plan
    from crosscheck.planning.result import Plan
    from crosscheck.planning.write import write_plan
    from crosscheck.studies.study import Study, study
    from crosscheck.suite.agreement import Thresholds, load_thresholds
    from crosscheck.suite.cases import Case, shipped_cases, user_cases
    from crosscheck.suite.results import CaseResult
    from crosscheck.suite.run import Run, run_suite
    from crosscheck.suite.write import write_run
    from crosscheck.twin.hidden import unseal
    from crosscheck.twin.make import Twin, make_twin

# Imported when first used: SciPy, MuJoCo and the compiled loop take a while to load.
_MODULES = {
    "add": ("Addition", "add_effect", "add_effects"),
    "calibration": ("Calibrated", "calibrate"),
    "comparison.limits": ("Limits", "exceeded", "load_limits"),
    "comparison.models": ("ComparedValue", "ModelComparison", "compare_models"),
    "comparison.residuals": ("compare",),
    "comparison.result": ("Comparison",),
    "controlled.control": ("Timing", "control_in_time"),
    "controlled.machine": ("Winches",),
    "controlled.result": ("TimedControl",),
    "diagnosis.result": ("Diagnosis", "MissingEffect", "Tolerance"),
    "diagnosis.diagnose": ("diagnose",),
    "errors": ("CrosscheckError", "UnsolvedError"),
    "fit.reasons": ("DiagnosisVerdict",),
    "importing.case": ("Imported", "import_case"),
    "importing.choices": ("ImportChoices",),
    "measurements.arrays": ("Measurements",),
    "measurements.data": ("Sigma",),
    "measurements.read": ("load_commands", "load_measurements"),
    "measurements.write": ("write_measurements",),
    "model.fitted": ("load_diagnosed",),
    "model.write": ("save_model",),
    "planning.design": ("choose_poses", "make_plan",),
    "planning.result": ("Plan",),
    "planning.write": ("write_plan",),
    "studies.study": ("Study", "study"),
    "suite.cases": ("Case", "shipped_cases", "user_cases"),
    "suite.results": ("CaseResult",),
    "suite.run": ("Run", "run_suite"),
    "suite.agreement": ("Thresholds", "load_thresholds"),
    "suite.write": ("write_run",),
    "twin.hidden": ("unseal",),
    "twin.make": ("Twin", "make_twin"),
}  # fmt: skip
_WHERE = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "Addition",
    "Calibrated",
    "Case",
    "CaseResult",
    "ComparedValue",
    "Comparison",
    "CrosscheckError",
    "Diagnosis",
    "DiagnosisVerdict",
    "ImportChoices",
    "Imported",
    "Limits",
    "Measurements",
    "MissingEffect",
    "ModelComparison",
    "Plan",
    "Run",
    "Sigma",
    "Study",
    "Thresholds",
    "TimedControl",
    "Timing",
    "Tolerance",
    "Twin",
    "UnsolvedError",
    "Winches",
    "add_effect",
    "add_effects",
    "calibrate",
    "choose_poses",
    "compare",
    "compare_models",
    "control_in_time",
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
    "study",
    "unseal",
    "user_cases",
    "write_measurements",
    "write_plan",
    "write_run",
]

pictured(__name__, "show.pictures")
__getattr__ = lazily(__name__, _WHERE)


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
