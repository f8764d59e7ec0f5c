"""Exceptions of crosscheck: each message is one line, for the person who can mend the cause."""

from __future__ import annotations

from seecr.errors import SeecrError


class CrosscheckError(SeecrError):
    """Arguments, options or data that crosscheck cannot work with."""


class UnsolvedError(CrosscheckError):
    """Rows that have no equilibrium, or a fit that does not converge."""

    exit_status = 3
