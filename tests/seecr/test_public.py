"""What ``import seecr`` gives, on first use, and which version it says that it is."""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys
from email.parser import Parser
from pathlib import Path

import pytest
from sources import ROOT

import seecr
from seecr import version
from seecr.lazy import lazily


@pytest.mark.parametrize("name", seecr.__all__)
def test_every_name_is_there_and_documented(name: str) -> None:
    value = getattr(seecr, name)
    assert value.__name__ == name
    assert len(inspect.getdoc(value) or "") > 20
    assert name in dir(seecr)


def test_types_are_told_of_the_same_names() -> None:
    tree = ast.parse(Path(inspect.getfile(seecr)).read_text(encoding="utf-8"))
    typed = next(n for n in tree.body if isinstance(n, ast.If))
    names = [a.name for n in typed.body if isinstance(n, ast.ImportFrom) for a in n.names]
    assert sorted(names) == sorted(seecr.__all__) == sorted(seecr._WHERE)


def test_workspaces_and_the_inverse_are_there_as_modules() -> None:
    words = "import seecr; print(seecr.workspace.feasible.__name__, seecr.inverse.correct.__name__)"
    got = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert got.stdout.split() == ["feasible", "correct"]


@pytest.mark.parametrize("folder", ["workspace", "inverse"])
def test_a_public_folder_gives_what_the_package_gives(folder: str) -> None:
    module = getattr(seecr, folder)
    assert {name: getattr(module, name) for name in module.__all__} == {
        name: getattr(seecr, name) for name in module.__all__
    }


@pytest.mark.slow
def test_importing_all_of_it_by_name_loads_nothing_heavy() -> None:
    code = (
        "import sys, seecr; dir(seecr); seecr.Robot, seecr.Term, seecr.model_path, seecr.Status;"
        "print('mujoco' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


# --- predict -------------------------------------------------------------------------------------


# --- Names of a package that are imported on first use


def test_names_come_from_the_module_that_defines_them_and_modules_by_themselves() -> None:
    get = lazily("email", {"Parser": "parser", "header": "nowhere"}, ["header"])
    assert get("Parser") is Parser
    assert get("header") is sys.modules["email.header"]


def test_what_is_not_public_is_an_attribute_error_though_the_module_has_it() -> None:
    """Which ``hasattr`` and ``from package import name`` need."""
    get = lazily("email", {"Parser": "parser"})
    for name in ("BytesParser", "parser"):
        with pytest.raises(AttributeError, match=f"^module 'email' has no attribute '{name}'$"):
            get(name)


# --- The version names the commit, in a checkout, in a worktree, and in a wheel built from one


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
