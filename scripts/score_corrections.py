"""Measure, diagnose, correct, measure again: by how much MuJoCo twins come nearer their commands.

    python scripts/score_corrections.py --seeds 1 2      some
    python scripts/score_corrections.py                  those of docs/diagnosis.md, minutes
    python scripts/score_corrections.py --calibrated     with models of crosscheck calibrate
    python scripts/score_corrections.py --aligned        which suppose that the tracker is right

Each twin of Cogiro hides what its seed draws; the diagnosis knows its measurements alone. The
paper's sweeps at both heights are then commanded as they are, and corrected for what was found;
MuJoCo, with what is hidden, says where the platform comes to rest. A calibrated model shares errors
between robot and tracker: corrected are the platform's poses in the base frame, and what is read.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from crosscheck.calibration import calibrate
from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.suite.cases import demobot_sweep
from crosscheck.twin.make import make_twin
from crosscheck.twin.measure import measure
from seecr.commands import Commands
from seecr.description.mjcf import model_path
from seecr.inverse.correction import correct
from seecr.pose import Array
from seecr.prediction.experiment import placed

ROBOT = "demobot_cogiro"
TRACKER = ("tracker_frame", "tracker_target", "tracker_scale")
# Seeds 3 and 11 hide nothing and 12 only a tracker's scale, which moves no robot.
SEEDS = (1, 2, 4, 5, 6, 7, 8, 9, 10)
# Of each sweep; seconds from pose to pose, and degrees Celsius all the time.
POSES, SECONDS, WARMTH = 12, 10.0, 22.0


def score(seed: int) -> str:
    """One twin in a line: what it hides, what was found, rms [mm] off its commands."""
    path = model_path(ROBOT)
    twin = make_twin(path, seed)
    found = diagnose(path, twin.measured)
    poses = np.concatenate([demobot_sweep(z, POSES) for z in (0.1, 0.2)])
    n = len(poses)
    told = Commands(poses, time=SECONDS * np.arange(float(n)), temperature=np.full(n, WARMTH))
    corrected = correct(twin.robot, told, effects=found.terms)
    hidden = [term.effect() for term in twin.hidden]

    def rms(commands: Commands) -> float:
        rests: Array = measure(twin.robot, commands, hidden).pose
        away = (rests - poses)[corrected.reached, :3]
        return float(1e3 * np.sqrt(np.mean(np.sum(away**2, axis=1))))

    before, after = rms(told), rms(corrected.commands)
    names = [" ".join(sorted(t.name for t in terms)) or "-" for terms in (twin.hidden, found.terms)]
    return (
        f"seed {seed}: hidden {names[0]}; found {names[1]}; {int(corrected.reached.sum())} of {n} "
        f"reached; {before:.4f} mm, corrected {after:.4f} mm, factor {before / after:.0f}"
    )


def score_aligned(seed: int) -> str:
    """With a calibrated model without the tracker's effects."""
    return score_calibrated(seed, exclude=TRACKER)


def score_calibrated(seed: int, exclude: Sequence[str] = ()) -> str:
    """The same with a calibrated model, of what is and of what is read, both ways of aiming."""
    path = model_path(ROBOT)
    twin = make_twin(path, seed)
    terms = calibrate(path, twin.measured, exclude=exclude).terms
    poses = np.concatenate([demobot_sweep(z, POSES) for z in (0.1, 0.2)])
    n = len(poses)
    told = Commands(poses, time=SECONDS * np.arange(float(n)), temperature=np.full(n, WARMTH))
    based = correct(twin.robot, told, effects=terms)
    aimed = correct(twin.robot, placed(twin.robot, told, terms), effects=terms)
    both = based.reached & aimed.reached
    hidden = [term.effect() for term in twin.hidden]

    def rms(commands: Commands) -> Array:
        found = measure(twin.robot, commands, hidden)
        away = [(at - poses[:, :3])[both] for at in (found.pose[:, :3], found.position)]
        return np.array([1e3 * np.sqrt(np.mean(np.sum(one**2, axis=1))) for one in away])

    names, before = " ".join(sorted(term.name for term in twin.hidden)), rms(told)
    words = [f"seed {seed}: hidden {names or '-'}; {int(both.sum())} of {n} reached"]
    for name, found in (("in the base frame", based), ("as read", aimed)):
        after = rms(found.commands)
        words += [
            f"corrected {name}: {what} {old:.4f} mm, then {new:.4f} mm, factor {old / new:.1f}"
            for what, old, new in zip(("is", "read"), before, after, strict=True)
        ]
    return "; ".join(words)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="*", default=list(SEEDS))
    parser.add_argument("--calibrated", action="store_true")
    parser.add_argument("--aligned", action="store_true")
    given = parser.parse_args()
    way = score_aligned if given.aligned else score_calibrated if given.calibrated else score
    for seed in given.seeds:
        print(way(seed), flush=True)


if __name__ == "__main__":
    main()
