"""Exceptions of seecr: each message is one line, for the person who made the mistake."""

from __future__ import annotations


class SeecrError(ValueError):
    """Base of every error raised on purpose by seecr."""


class RobotError(SeecrError):
    """A robot description (MJCF or numbers) that does not describe a cable robot."""


class InputError(SeecrError):
    """Arguments of a wrong shape, unit or value."""
