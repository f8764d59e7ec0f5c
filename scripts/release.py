"""Make a release: check, build, and tag what is built.

    python scripts/release.py 0.2.0            all but the tag
    python scripts/release.py 0.2.0 --tag      and the tag v0.2.0

The version must stand in pyproject.toml, seecr/__init__.py, CITATION.cff and CHANGELOG.md, with a
date there. The tree must be clean. The wheel and the source archive are built into ``dist``; the
wheel is installed into a new virtual environment and used from there. Nothing is published: that
is the maintainer's own step, which the last line names.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# Where the version stands, and how.
PLACES = {
    "pyproject.toml": r'^version = "{}"$',
    "seecr/__init__.py": r'^__version__ = "{}"$',
    "CITATION.cff": r"^version: {}$",
    "CHANGELOG.md": r"^## \[{}\], \d{{4}}-\d\d-\d\d$",
}


def faults(version: str, root: Path = ROOT) -> list[str]:
    """What is missing for a release of this version, a line each."""
    found = [] if re.fullmatch(r"\d+\.\d+\.\d+", version) else [f"{version}: expected as 0.2.0"]
    for name, pattern in PLACES.items():
        line = pattern.format(re.escape(version))
        if not re.search(line, (root / name).read_text(encoding="utf-8"), re.MULTILINE):
            found.append(f"{name}: no line that matches {line}")
    if output("git", "status", "--porcelain", root=root):
        found.append("the tree has changes that are not committed")
    if output("git", "tag", "--list", f"v{version}", root=root):
        found.append(f"the tag v{version} is there already")
    return found


def output(*words: str, root: Path = ROOT) -> str:
    return subprocess.run(
        words, cwd=root, capture_output=True, text=True, check=True
    ).stdout.strip()


def run(*words: str | Path) -> None:
    print("$", *words, flush=True)
    subprocess.run([str(word) for word in words], cwd=ROOT, check=True)


def main(version: str, tag: bool) -> int:
    """Check, build, try, and tag; the status."""
    if found := faults(version):
        print(*found, sep="\n", file=sys.stderr)
        return 2
    run(ROOT / ".ci" / "run")
    with tempfile.TemporaryDirectory() as place:
        python = Path(place, "bin", "python")
        run(sys.executable, "-m", "venv", place)
        run(python, "-m", "pip", "install", "-q", "build")
        run(python, "-m", "build", "--outdir", "dist")
        run(python, "-m", "pip", "install", "-q", f"dist/seecr-{version}-py3-none-any.whl")
        run(python, "scripts/smoke_wheel.py")
    if tag:
        run("git", "tag", "--annotate", f"v{version}", "--message", f"seecr {version}")
    print(f"dist/ holds seecr {version}; to publish: push the tag, and upload dist/ with twine")
    return 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("version")
    parser.add_argument("--tag", action="store_true")
    given = parser.parse_args()
    sys.exit(main(given.version, given.tag))
