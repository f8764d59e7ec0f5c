"""Run the suite, the score, the bench and the paper from one commit, and check their numbers.

    python scripts/reproduce.py           all cases, an hour: docs/figures.json and the pages
    python scripts/reproduce.py --short   a tenth of the cases and two robots; nothing is written

If a number is outside its interval, the pages stay and the status is 1; build/reproduced.json has
all figures.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from difflib import unified_diff
from pathlib import Path
from typing import Any

import bench
import make_paper
import score
from scipy.stats import betabinom

from seecr.columns.cells import decimals
from seecr.files import write_text

ROOT = Path(__file__).resolve().parents[1]
DOCS, FOUND, PAGE = ROOT / "docs", ROOT / "build" / "reproduced.json", make_paper.PAGE
ROUNDED = re.compile(r"\d+\.\d+(?:e[-+]\d+)?")
INTERVALS = {
    "counts": 0.05,  # chance that any of them is outside though nothing changed: binomial
    "ratios": 2.0,  # a factor: runs beside other work were up to 1.4 apart
}
"""How far numbers may be from those that are kept, by what they are. Closed values of the paper may
move by a unit of their last digit, as rounding does, and the suite has thresholds of its own.
"""


def main() -> int:
    """Run everything, say what is outside its interval, and write the pages if nothing is."""
    parser = argparse.ArgumentParser(description="see the head of this file")
    parser.add_argument("--short", action="store_true", help="under ten minutes on two cores")
    short = parser.parse_args().short
    if changed := git("status", "--short", "-uno"):
        sys.exit(f"expected a commit and nothing changed since, got:\n{changed}")
    kept = json.loads((DOCS / "figures.json").read_text(encoding="utf-8"))
    page = PAGE.read_text(encoding="utf-8")
    try:
        found = run_all(short, kept)
        now = PAGE.read_text(encoding="utf-8")
    finally:
        write_text(PAGE, page)
    text = json.dumps(found, indent=1) + "\n"
    write_text(FOUND, text)
    if faults := [*faults_of(kept, found), *moved(page, now)]:
        print("\n".join(["outside its interval:", *faults]))
        return 1
    if not short:
        write_text(DOCS / "figures.json", text)
        write_text(PAGE, now)
        score.write_page(DOCS / "diagnosis.md", found["diagnosis"])
        write_text(DOCS / "performance.md", bench.page_of(found["speed"]))
    print(f"all numbers of commit {found['commit']} are inside their intervals")
    return 0


def moved(page: str, now: str) -> list[str]:
    """Lines of a page that differ by more than a unit of the last digit of a rounded number."""
    was, lines = page.splitlines(), now.splitlines()
    if len(was) == len(lines):
        lines = [a if alike(a, b) else b for a, b in zip(was, lines, strict=True)]
    return [*unified_diff(was, lines, PAGE.name, "now", n=0, lineterm="")]


def alike(one: str, other: str) -> bool:
    """Whether two lines say the same: numbers with a point may be rounded to either side."""
    if ROUNDED.sub("#", one) != ROUNDED.sub("#", other):
        return False
    pairs = zip(ROUNDED.findall(one), ROUNDED.findall(other), strict=True)
    # in units of the last digit; 1.5 is between one unit and two, which binary fractions blur
    return all(
        abs(float(a) - float(b)) * 10.0 ** max(decimals(a), decimals(b)) < 1.5 for a, b in pairs
    )


def git(*words: str) -> str:
    """What git answers."""
    return subprocess.check_output(["git", "-C", str(ROOT), *words], text=True).strip()


def run_all(short: bool, kept: dict[str, Any]) -> dict[str, Any]:
    """The figures of all scripts; those of the paper go into its page."""
    less, older = ["--short"] if short else [], ["--before", kept["speed"]["before"]]
    FOUND.parent.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        out, suite = Path(folder) / "figures.json", Path(folder) / "suite"
        ended = run("-m", "crosscheck", "run", "--no-recordings", "--out", suite)
        run("scripts/score.py", *less, "--seed", kept["diagnosis"]["seed"], "--out", out)
        run("scripts/bench.py", *(less or older), "--out", out)
        run("scripts/make_paper.py", *(["--numbers"] if short else []))
        for name in () if short else ("link_words", "explain_figure_12", "paper_control"):
            run(f"scripts/{name}.py")
        found = json.loads(out.read_text(encoding="utf-8"))
        poses = json.loads((suite / "results.json").read_text(encoding="utf-8"))["poses"]
    return {**found, "suite": {"exit_status": ended, **poses}, "commit": git("rev-parse", "HEAD")}


def run(*words: object) -> int:
    """The status with which a script ends; more than 1 is no answer, and ends this one, too."""
    print("reproduce:", *words, file=sys.stderr, flush=True)
    ended = subprocess.run([sys.executable, *map(str, words)], cwd=ROOT, stdout=sys.stderr)
    if ended.returncode > 1 or (ended.returncode and words[0] != "-m"):
        sys.exit(f"{words[0]} ended with status {ended.returncode}")
    return ended.returncode


def faults_of(kept: dict[str, Any], found: dict[str, Any]) -> Iterator[str]:
    """What is outside its interval about the figures that are kept, a line each."""
    if found["suite"]["exit_status"]:
        yield "suite: a threshold is exceeded; crosscheck run says where"
    before, now = counts(kept["diagnosis"]), counts(found["diagnosis"])
    for name, (k, n) in now.items():
        # what k of n says of a chance, as a distribution, and what that says of new ones
        was, of = before[name]
        new = betabinom(n, was + 0.5, of - was + 0.5)
        low, high = new.interval(1.0 - INTERVALS["counts"] / len(now))
        if not low <= k <= high:
            yield f"{name}: {k} of {n}, expected {low:g} to {high:g} (it was {was} of {of})"
    old, factor = ratios(kept["speed"]), INTERVALS["ratios"]
    for name, one in ratios(found["speed"]).items():
        if not old[name] / factor <= one <= old[name] * factor:
            yield f"{name}: {one:.3g} times, expected {old[name]:.3g} to a factor of {factor:g}"


def counts(found: dict[str, Any]) -> dict[str, tuple[int, int]]:
    """What of the diagnosis is so many of so many."""
    several, tolerances, out = found["several"], found["tolerances"], {}
    share, error = found["intervals"]["share"], found["intervals"]["stderr"]
    # values of one twin are off together: as many as are independent have this standard error
    n = round(share * (1.0 - share) / error**2) if error else found["intervals"]["count"]
    out["names that are true"] = (found["names"] - found["false_names"], found["names"])
    out["named of several"] = (several["named"], several["owed"])
    out["several found"] = (several["effects_found"], several["cases"])
    out["many effects"] = (tolerances["many_effects"], tolerances["cases"])
    out["intervals with the truth"] = (round(share * n), n)
    for size in dict.fromkeys(size for by in found["named_by_size"].values() for size in by):
        cells = [by[size] for by in found["named_by_size"].values() if size in by]
        out[f"named of {size} sigma"] = (sum(c[0] for c in cells), sum(c[1] for c in cells))
    for kind, verdict in (("nulls", "no_effect_missing"), ("unknown", "unknown_effect")):
        each = found[kind].values()
        every = sum(sum(one.values()) for one in each)
        out[f"{kind} seen"] = (sum(one.get(verdict, 0) for one in each), every)
    return out


def ratios(found: dict[str, Any]) -> dict[str, float]:
    """How many times longer other ways take, and one pose alone than sixteen at once."""
    out = {f"{row[0]}, E S {row[2]} N, alone": float(row[-1]) for row in found["robots"]}
    for name, times in found["ratios"].items():
        out |= {f"{name}, {way}": times[way] / times["seecr"] for way in ("paper", "mujoco")}
    return out


if __name__ == "__main__":
    sys.exit(main())
