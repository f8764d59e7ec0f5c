"""The documentation site builds from the pages as they are, without a warning."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import seecr

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def test_the_site_leads_to_every_page() -> None:
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    trees = "\n".join(re.findall(r"```\{toctree\}\n(.*?)```", index, re.DOTALL))
    listed = {(ROOT / "docs" / line).resolve() for line in trees.split("\n") if line}
    missing = {page for page in PAGES if page.with_suffix("") not in listed}
    assert missing == {ROOT / "docs" / "index.md"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "notebook",
    [
        "off",  # test_examples.py runs its cells, and compares what they show
        pytest.param("force", marks=pytest.mark.sweep),
    ],
)
def test_the_site_builds_without_warnings(notebook: str, tmp_path: Path) -> None:
    for package in ("sphinx", "myst_nb", "furo"):
        pytest.importorskip(package, reason="the site is built with: pip install '.[docs]'")
    build = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-c", "docs"]
    build += ["-D", f"nb_execution_mode={notebook}"]
    run = subprocess.run(
        [*build, "-d", str(tmp_path / "read"), ".", str(tmp_path / "site")],
        cwd=ROOT,
        # the notebook's kernel starts elsewhere and takes the package that is tested here
        env={**os.environ, "PYTHONPATH": str(Path(seecr.__file__).resolve().parents[1])},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr
    page = (tmp_path / "site" / "docs" / "formats.html").read_text(encoding="utf-8")
    assert 'href="effects.html"' in page and 'href="../README.html"' in page
