"""The version names the commit, in a checkout, in a worktree, and in a wheel built from one."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from sources import ROOT

import seecr
from seecr import version

COMMIT = "0123456789abcdef0123456789abcdef01234567"


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An installed package whose folder stands in an empty one."""
    folder = tmp_path / "seecr"
    folder.mkdir()
    monkeypatch.setattr(version, "_PACKAGE", folder)
    version.full_version.cache_clear()
    monkeypatch.setattr(version, "full_version", version.full_version.__wrapped__)
    return folder


def test_without_a_commit_it_is_that_of_the_release(package: Path) -> None:
    assert version.full_version() == seecr.__version__
    (package / "commit.txt").write_bytes(b"\xff\xfe")
    assert version.full_version() == seecr.__version__


def test_a_wheel_says_what_it_was_built_from(package: Path) -> None:
    (package / "commit.txt").write_text(f"{COMMIT}\n")
    assert version.full_version() == f"{seecr.__version__}+g01234567"


@pytest.mark.parametrize("kind", ["detached", "loose", "packed", "worktree"])
def test_a_checkout_says_where_it_stands(package: Path, kind: str) -> None:
    git = package.parent / ".git"
    own = git
    if kind == "worktree":
        git = package.parent / "main.git"
        own = git / "worktrees" / "one"
        (package.parent / ".git").write_text(f"gitdir: {own}\n")
    own.mkdir(parents=True)
    if kind == "worktree":
        (own / "commondir").write_text("../..\n")
    (own / "HEAD").write_text(f"{COMMIT}\n" if kind == "detached" else "ref: refs/heads/a/b\n")
    if kind == "packed":
        (git / "packed-refs").write_text(f"# pack-refs with: peeled\n{COMMIT} refs/heads/a/b\n")
    else:
        (git / "refs/heads/a").mkdir(parents=True)
        (git / "refs/heads/a/b").write_text(f"{COMMIT}\n")
    assert version.full_version() == f"{seecr.__version__}+g01234567"


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="no checkout of Git")
def test_it_is_what_git_says() -> None:
    words = ["git", "-C", str(ROOT), "rev-parse", "HEAD"]
    commit = subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()
    assert version._checked_out(ROOT) == commit
