"""The command line. Each command lives in its own module, imported only when it is used."""

from __future__ import annotations

from seecr.cli.group import group_of

# Command, module in crosscheck.cli that holds it as `command`, and its line in --help.
COMMANDS: dict[str, tuple[str, str]] = {
    "run": ("run", "Settle every shipped robot in MuJoCo, solve it with SEECR, compare."),
    "compare": ("compare", "Hold a model against measurements."),
    "diagnose": ("diagnose", "Find which effects a model misses, from measurements."),
    "plan": ("plan", "Before measuring: what planned poses will be able to show."),
    "add": ("add", "Fit an effect to measurements and add it to a model."),
    "calibrate": ("calibrate", "Fit all effects at once to measurements, for predicting."),
    "import": ("importing", "Other people's recordings into measurements."),
    "effects": ("effects", "The catalogue of effects, and how to check each by hand."),
    "twin": ("twin", "Make measurements with a hidden effect, MuJoCo being the truth."),
}


@group_of("crosscheck.cli", COMMANDS)
def main() -> None:
    """Hold the statics of a cable-driven parallel robot against MuJoCo and against measurements.

    \b
    ROBOT.xml is an MJCF file, or the name of a shipped robot (demobot_cogiro, planar_vertical ...).
    Exit status: 0 all well, 1 a threshold exceeded, 2 bad input or usage,
    3 a solve did not converge.
    """
