"""Diagnose the labelled laboratories by the command line, and predict their other trajectory.

    python scripts/score_labs.py ../shared/data/labs               all cases
    python scripts/score_labs.py ../shared/data/labs B13 B16       some
    python scripts/score_labs.py ../shared/data/labs --markdown    as docs/diagnosis.md has them
    python scripts/score_labs.py ../shared/data/labs --understate 3.5    sigma stated too small

``diagnose --model-out`` finds a model on measured.csv; where its verdict is many_effects,
``calibrate`` does. ``compare`` tries it on validation.csv, another trajectory of the same robot,
and the true model too, made of the values in answers.json. A line is a case: what was hidden,
the verdict, the names, and the model's errors there over those of the true model.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from click.testing import CliRunner
from true_models import as_toml, is_known, true_terms

from crosscheck.cli import main as crosscheck
from seecr.description.mjcf import load_robot

# A command's arguments, and what it prints as JSON.
Command = Callable[..., dict[str, Any]]


def command(*arguments: object) -> dict[str, Any]:
    """A command of ``crosscheck``, which must succeed."""
    done = CliRunner().invoke(crosscheck, [*map(str, arguments), "--json"])
    if done.exit_code:
        raise RuntimeError(f"crosscheck {' '.join(map(str, arguments))}: {done.output}")
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@dataclass(frozen=True)
class Lab:
    """What the commands said of one case.

    Attributes:
        diagnosis: diagnosis.json.
        ratio: rms errors on validation.csv over those of the true model, by kind of reading;
            empty where something is hidden that no catalogue holds, or no validation.csv is there.
        plain: the same without any effect.
        rows: of the measurements.
        seconds: of processor for the diagnosis, with its page.
    """

    name: str
    answer: dict[str, Any]
    diagnosis: dict[str, Any]
    rows: int
    seconds: float
    ratio: dict[str, float] = field(default_factory=dict)
    plain: dict[str, float] = field(default_factory=dict)

    @property
    def verdict(self) -> str:
        return str(self.diagnosis["verdict"])

    @property
    def named(self) -> list[list[str]]:
        """Each listed effect with what cannot be told from it."""
        return [[m["effect"], *m["indistinguishable"]] for m in self.diagnosis["missing"]]

    @property
    def worst(self) -> float:
        return max(self.ratio.values())


def understated(case: Path, out: Path, factor: float) -> Path:
    """A copy of a case in ``out``, every sigma that it states divided by ``factor``."""
    copy = out / case.name
    shutil.copytree(case, copy)
    for path in copy.glob("*.toml"):
        text = path.read_text(encoding="utf-8")
        sigma = r"(?m)^(\w+_(?:m|rad|N) *= *)([\d.e+-]+)"
        smaller = re.sub(sigma, lambda found: f"{found[1]}{float(found[2]) / factor}", text)
        path.write_text(smaller, encoding="utf-8")
    return copy


def asked(folder: Path, out: Path, name: str, factor: float = 1.0) -> Lab:
    """One case by its commands, which write into ``out``; its sigma divided by ``factor``."""
    case = understated(folder / name, out, factor)
    robot = case / "robot.xml"
    data = [case / name for name in ("measured.csv", "second.csv") if (case / name).exists()]
    answer = json.loads((folder / "answers.json").read_text(encoding="utf-8"))[name]
    model = out / "model.toml"
    start = time.process_time()
    found = command(
        "diagnose", robot, *data, "--out", out / "diagnosis", "--no-recording", "--model-out", model
    )
    spent = time.process_time() - start
    if found["verdict"] == "many_effects":
        model.unlink(missing_ok=True)
        command("calibrate", robot, *data, "--model", model)
    rows = sum(len(one.read_text(encoding="utf-8").splitlines()) - 1 for one in data)
    lab = Lab(name, answer, found, rows, spent)
    if not is_known(answer["values"]) or not (case / "validation.csv").exists():
        return lab
    true = out / "true.toml"
    terms = true_terms(answer["values"], load_robot(robot))
    true.write_text(as_toml(terms), encoding="utf-8")
    best, found_there, plain = (_elsewhere(case, out, one) for one in (true, model, None))
    return replace(lab, ratio=_over(found_there, best), plain=_over(plain, best))


def _elsewhere(case: Path, out: Path, model: Path | None) -> dict[str, float]:
    """Rms errors on the other trajectory, with a model if there is one."""
    arguments = ["--model", model] if model is not None and model.exists() else []
    files = (case / "robot.xml", case / "validation.csv")
    found = command("compare", *files, *arguments, "--no-recording", "--out", out / "comparison")
    return {key: value for key, value in found["rms"].items() if value is not None}


def _over(errors: dict[str, float], true: dict[str, float]) -> dict[str, float]:
    return {key.split("_")[0]: errors[key] / true[key] for key in true}


def line(lab: Lab) -> str:
    """A case as a line of the terminal."""
    return f"{lab.name}: {'; '.join(filter(None, _cells(lab)))}; {lab.seconds:.1f} s"


def row(lab: Lab) -> str:
    """A case as a row of the table in docs/diagnosis.md."""
    return f"| {lab.name} | {' | '.join(cell or _NONE for cell in _cells(lab))} |"


def _cells(lab: Lab) -> tuple[str, ...]:
    hidden = lab.answer["hidden"]
    options = [
        _OPTIONS.get(k, {}).get(value, "") for k, value in lab.answer.get("options", {}).items()
    ]
    return (
        _HIDDEN.get(hidden[0]) or ", ".join(f"`{name}`" for name in hidden),
        ", ".join(filter(None, options)),
        f"`{lab.verdict}`",
        ", ".join(" or ".join(f"`{name}`" for name in names) for names in lab.named),
        ", ".join(f"{value:.2f}" for value in lab.plain.values()),
        ", ".join(f"{value:.2f}" for value in lab.ratio.values()),
    )


_NONE = "–"
_HIDDEN = {"null": "nothing", "sink": "all tolerances"}
# What was done to readings and noise, in words.
_OPTIONS: dict[str, dict[Any, str]] = {
    "noise": {"ar1": "autocorrelated", "outliers": "outliers", "t3": "heavy tails"},
    "stated": {0: "not stated", 0.5: "half stated", 2: "twice stated"},
    "read": {"position": "positions alone"},
    "tensions": {True: "tensions too"},
    "n": {5: "30 rows"},
    "rich": {},
}
_HEADER = (
    "| case | hidden | readings and noise | verdict | listed or sure | error ratio without effects "
    "| with the model found |"
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("cases", nargs="*")
    parser.add_argument("--markdown", action="store_true", help="print a table")
    parser.add_argument(
        "--understate", type=float, default=1.0, metavar="F", help="divide the stated sigma"
    )
    chosen = parser.parse_args()
    answers = json.loads((chosen.folder / "answers.json").read_text(encoding="utf-8"))
    if chosen.markdown:
        print(_HEADER, "|---" * (_HEADER.count("|") - 1) + "|", sep="\n")
    for name in chosen.cases or sorted(answers):
        with tempfile.TemporaryDirectory() as out:
            lab = asked(chosen.folder, Path(out), name, chosen.understate)
        print(row(lab) if chosen.markdown else line(lab), flush=True)


if __name__ == "__main__":
    main()
