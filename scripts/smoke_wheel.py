"""Use what pip installed as its user would: outside the checkout, where only the wheel is seen.

    python scripts/smoke_wheel.py

Ends 0 if the commands start and a pose of a shipped robot is solved, else with the first failure.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]

SOLVE = """
import seecr
from seecr.description.mjcf import model_path
from crosscheck.show.glossary import entries

robot = seecr.load_robot(model_path("demobot_cogiro"))
solution = seecr.solve(robot, [[0.4, 0.25, 0.1, 1, 0, 0, 0]])
assert solution.converged.all(), solution.status
assert entries(), "the glossary of the pages"
print(seecr.__file__)
"""


def main() -> None:
    """Start the commands, solve a pose, and make sure that no file was the checkout's own."""
    bin_folder = Path(sys.executable).parent
    for command in (["--help"], ["run", "--list"]):
        run([str(bin_folder / "crosscheck"), *command])
    # interpreted: to compile the search takes a minute, to interpret it for one pose does not
    module = run([sys.executable, "-c", SOLVE], NUMBA_DISABLE_JIT="1").strip()
    if Path(module).is_relative_to(CHECKOUT / "seecr"):
        sys.exit(f"expected the installed seecr, got that of the checkout, {module}")
    print(f"the wheel works: {module}")


def run(command: list[str], **environment: str) -> str:
    """What a command prints, run in an empty folder without a Python path."""
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            command, cwd=folder, env=kept | environment, stdout=subprocess.PIPE, text=True
        )
    if done.returncode:
        sys.exit(f"{' '.join(command[:3])}: ended {done.returncode}")
    return done.stdout


if __name__ == "__main__":
    main()
