"""Keeps MuJoCo from leaving files in the folder where a command runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

_lock = Lock()
_depth = 0


@contextmanager
def quiet_mujoco() -> Iterator[None]:
    """Keep MuJoCo from writing MUJOCO_LOG.TXT into the working folder; statuses report instead.

    Also a decorator, ``@quiet_mujoco()``. A handler of the user's own stays.
    """
    import mujoco

    global _depth
    with _lock:
        _depth += 1
        if _depth == 1 and mujoco.get_mju_user_warning() is None:
            mujoco.set_mju_user_warning(_ignore)
    try:
        yield
    finally:
        with _lock:
            _depth -= 1
            if _depth == 0 and mujoco.get_mju_user_warning() is _ignore:
                mujoco.set_mju_user_warning(None)


def _ignore(message: str) -> None:
    """Discard a warning of MuJoCo's."""
