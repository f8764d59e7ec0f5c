"""The version that results and models name: that of the release, and its commit."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from seecr import __version__

_PACKAGE = Path(__file__).resolve().parent
# Digits of a commit, as Git shows them.
_DIGITS = 8


@cache
def full_version() -> str:
    """The version, with the commit where it is known: ``0.1.0+g1a2b3c4d``."""
    commit = _built_from() or _checked_out(_PACKAGE.parent)
    return f"{__version__}+g{commit[:_DIGITS]}" if commit else __version__


def _built_from() -> str:
    """The commit that a wheel was built from, which ``scripts/commit_hook.py`` writes into it."""
    return _text(_PACKAGE / "commit.txt")


def _checked_out(checkout: Path) -> str:
    """The commit of a checkout; "" where there is none."""
    git = checkout / ".git"
    if git.is_file():  # of a worktree, whose folder is elsewhere
        git = checkout / _text(git).removeprefix("gitdir:").strip()
    head = _text(git / "HEAD")
    if not head.startswith("ref:"):
        return head
    ref = head.removeprefix("ref:").strip()
    common = git / (_text(git / "commondir") or ".")
    if found := _text(git / ref) or _text(common / ref):
        return found
    packed = (line.split() for line in _text(common / "packed-refs").splitlines())
    return next((words[0] for words in packed if words[1:] == [ref]), "")


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8").strip()
    except (OSError, ValueError):
        return ""
