"""A hook of the build: a wheel says which commit it was built from."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CommitHook(BuildHookInterface):
    """Writes ``seecr/commit.txt`` into the wheel, if this is a checkout of Git."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Before a wheel is built; an editable install asks the checkout itself, later."""
        if version == "editable":
            return
        try:
            done = subprocess.run(
                ["git", "rev-parse", "HEAD"], cwd=self.root, capture_output=True, text=True
            )
        except OSError:
            return  # no Git: the version alone is known
        if done.returncode == 0:
            path = Path(tempfile.mkdtemp()) / "commit.txt"
            path.write_text(done.stdout, encoding="utf-8")
            build_data["force_include"][str(path)] = "seecr/commit.txt"
