"""The command line. Each command lives in its own module, imported only when it is used."""

from __future__ import annotations

from seecr.cli.group import LazyGroup

# Command, module in crosscheck.cli that holds it as `command`, and its line in --help.
COMMANDS: dict[str, tuple[str, str]] = {
    "run": ("run", "Solve every shipped robot with SEECR, settle it in MuJoCo, and compare."),
    "compare": ("compare", "Compare a model with measurements."),
    "diagnose": ("diagnose", "Find from measurements which effects a model misses."),
    "plan": ("plan", "Before measuring: which effects the planned poses can reveal."),
    "add": ("add", "Fit an effect to measurements and add it to a model."),
    "calibrate": (
        "calibrate",
        ("Fit all effects at once to measurements, for a model that predicts well."),
    ),
    "import": ("importing", "Convert recordings of other programs into measurements."),
    "effects": ("effects", "List the catalogue of effects, and how to check each by hand."),
    "control": ("control", "Schemes of control in MuJoCo, with time, beside seecr control."),
    "study": ("study", "Do many maps, sweeps, diagnoses or twins, on many machines if need be."),
    "twin": ("twin", "Make measurements with a hidden effect, with MuJoCo as the truth."),
}

main = LazyGroup(
    "crosscheck.cli",
    COMMANDS,
    "Check the statics of a cable-driven parallel robot against MuJoCo and against measurements.",
    "ROBOT.xml",
)
