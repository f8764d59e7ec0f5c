"""Exceptions of crosscheck: each message is one line, for the person who can mend the cause."""

from __future__ import annotations

from seecr.errors import SeecrError


class CrosscheckError(SeecrError):
    """Arguments, options or data that crosscheck cannot work with."""
