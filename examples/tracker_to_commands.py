"""From a tracker's CSV to commands that bring the platform where it should be.

    python examples/tracker_to_commands.py

`tracker.csv` is what a spreadsheet writes: semicolons, decimal commas, millimetres and degrees;
`tracker.toml` beside it says how noisy the tracker is. Which effect the model misses is found from
them, added to the model, and taken into account in the lengths that are written at the end.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import crosscheck
import seecr

HERE = Path(__file__).resolve().parent
WANTED = np.array([[x, 0.25, 0.12, 1.0, 0.0, 0.0, 0.0] for x in (0.25, 0.4, 0.55)])


def main(out: Path) -> seecr.Correction:
    """Diagnose, add, correct; writes the lengths to tell the winches into `out`."""
    robot = seecr.load_robot(seecr.model_path("demobot_cogiro"))
    data = crosscheck.load_measurements(HERE / "tracker.csv", robot)
    print(crosscheck.compare(robot, data).sentence)

    found = crosscheck.diagnose(robot, data)
    print(f"{found.verdict.value}: {', '.join(one.effect for one in found.missing)}")
    added = crosscheck.add_effects(robot, data, found.terms)
    print(crosscheck.compare(robot, data, added.terms).sentence)

    plain = seecr.solve(robot, WANTED, effects=added.terms)
    corrected = seecr.correct(robot, WANTED, effects=added.terms, lowest=0.1)
    for i, x in enumerate(WANTED[:, 0]):
        off, turned = np.linalg.norm(plain.deviation[i].reshape(2, 3), axis=1)
        left, askew = np.linalg.norm(corrected.left[i].reshape(2, 3), axis=1)
        print(
            f"x {x:.2f} m: as it was {1e3 * off:.2f} mm and {np.degrees(turned):.2f} deg off, "
            f"corrected by the model {1e3 * left:.2f} mm and {np.degrees(askew):.2f} deg"
        )
    head = ",".join(f"length_{i + 1}_m" for i in range(robot.n_cables))
    np.savetxt(out, corrected.lengths, delimiter=",", header=head, comments="", fmt="%.6f")
    return corrected


if __name__ == "__main__":
    main(Path("corrected.csv"))
