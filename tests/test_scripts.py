"""Scripts: what a release needs, commands at once in one folder, what corrections gain."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
import release
from load import RESULTS, run
from packaging.requirements import Requirement
from score_corrections import score, score_aligned
from sources import ROOT

from seecr.folders import MANIFEST


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


@pytest.mark.slow
def test_commands_at_once_leave_one_result_and_nothing_over(tmp_path: Path) -> None:
    ends, left, results = run(8, 4, tmp_path)
    assert ends == ["0"] * 8, ends
    assert left == set()
    assert results == {f"out/{name}" for name in (*RESULTS, MANIFEST)}


@pytest.mark.sweep
@pytest.mark.parametrize("seed", [1, 4])
def test_with_the_model_of_the_diagnosis_platforms_come_35_times_nearer(seed: int) -> None:
    found = re.search(r"; ([0-9]+) of ([0-9]+) reached; .* factor ([0-9]+)$", score(seed))
    assert found is not None
    reached, every, factor = map(int, found.groups())
    assert reached > 0.8 * every and factor >= 35


@pytest.mark.sweep
@pytest.mark.parametrize("seed", [1, 2])
def test_with_a_calibrated_model_and_a_tracker_that_is_right_20_times(seed: int) -> None:
    found = re.search(r"in the base frame: is .* factor ([0-9.]+);", score_aligned(seed))
    assert found is not None and float(found[1]) >= 19.5
