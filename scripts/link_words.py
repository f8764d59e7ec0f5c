"""Link the glossary's own words where a page of docs/ first uses them.

    python scripts/link_words.py

A test goes red where a page uses one without a link.
"""

from __future__ import annotations

import re
from pathlib import Path

PAGES = sorted((Path(__file__).resolve().parents[1] / "docs").glob("*.md"))
_OWN = (
    "expected size", "test runs", "noise alone", "way point", "told length",
    "smallest visible size",
)  # fmt: skip
_TO = "](glossary.md)"
# Code, what is printed, and what a picture shows stay as they are.
_AS_IT_IS = re.compile(r"```.*?```|`[^`]*`|!\[[^\]]*\]", re.DOTALL)


def with_links(page: str) -> str:
    """The page with each of these words linked where it first stands."""
    for word in _OWN:
        running = _AS_IT_IS.sub(lambda part: "\0" * len(part[0]), page)
        words = r"\s+".join(word.split())
        first = re.search(rf"\b{words}s?\b", running, re.IGNORECASE)
        if first and not running.startswith(_TO, first.end()):
            page = f"{page[: first.start()]}[{first[0]}{_TO}{page[first.end() :]}"
    return page


if __name__ == "__main__":
    for path in PAGES:
        if path.name != "glossary.md":
            text = path.read_text(encoding="utf-8")
            path.write_text(with_links(text), encoding="utf-8")
