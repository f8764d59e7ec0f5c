"""Names of a package that are imported on first use."""

from __future__ import annotations

import subprocess
import sys
from email.parser import Parser

import pytest

from seecr.lazy import lazily


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


def test_nothing_is_imported_before_a_name_is_asked_for() -> None:
    words = (
        "import sys; from seecr.lazy import lazily; get = lazily('email', {'Parser': 'parser'});"
        "before = 'email.parser' in sys.modules; get('Parser');"
        "print(before, 'email.parser' in sys.modules)"
    )
    got = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert got.stdout.split() == ["False", "True"]
