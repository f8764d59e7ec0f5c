"""What a release needs is in place, and what is missing is said."""

from __future__ import annotations

import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
import release
from packaging.requirements import Requirement
from sources import ROOT


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A checkout with the files that name the version, all of it committed."""
    for name in release.PLACES:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copyfile(ROOT / name, tmp_path / name)
    changes = tmp_path / "CHANGELOG.md"
    text = changes.read_text(encoding="utf-8")
    changes.write_text(text.replace("[0.1.0], not yet released", "[0.1.0], 2026-11-29"))
    git(tmp_path, "init", "-q")
    commit(tmp_path)
    return tmp_path


def git(folder: Path, *words: str) -> None:
    own = ("-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false")
    subprocess.run(["git", *own, *words], cwd=folder, check=True, capture_output=True)


def commit(folder: Path) -> None:
    git(folder, "add", "-A")
    git(folder, "commit", "-q", "-m", "all", "--no-verify")


def test_a_tree_with_one_version_everywhere_may_be_released(copy: Path) -> None:
    assert release.faults("0.1.0", copy) == []


def test_what_is_missing_is_said_all_at_once(copy: Path) -> None:
    (copy / "note").write_text("not committed")
    git(copy, "tag", "v0.1.1")
    found = release.faults("0.1.1", copy)
    assert [line.split(":")[0] for line in found[:4]] == [*release.PLACES]
    assert found[4:] == [
        "the tree has changes that are not committed", "the tag v0.1.1 is there already"
    ]  # fmt: skip
    assert "expected as 0.2.0" in release.faults("1.0", copy)[0]


@pytest.mark.parametrize("python", ["3.11", "3.12", "3.13"])
def test_what_ci_installs_is_stated_and_within_bounds(python: str) -> None:
    """Each package of pyproject.toml has one version for each Python, and an allowed one."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = [project["dependencies"], *project["optional-dependencies"].values()]
    inside = {"python_version": python, "python_full_version": f"{python}.9"}
    lines = (ROOT / ".ci/constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [Requirement(line) for line in lines if not line.lstrip().startswith("#")]
    chosen = [pin for pin in pins if pin.marker is None or pin.marker.evaluate(inside)]
    for wanted in (Requirement(text) for group in groups for text in group):
        (pin,) = [one for one in chosen if one.name == wanted.name]
        (version,) = pin.specifier
        assert version.operator == "==" and version.version in wanted.specifier, wanted
