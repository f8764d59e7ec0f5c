"""How this package is compiled: cached on disk, and without Python's global lock."""

from __future__ import annotations

from llvmlite.binding import add_symbol
from numba import carray as carray  # type: ignore[attr-defined]
from numba import cfunc, config, njit, types
from numba.core import event

from seecr.compiled.compile_notice import watch

_COMMON = {"cache": True, "nogil": True, "error_model": "numpy"}
# Numba counts references to arrays, atomically, at every call and slice. That took three quarters
# of the time, as calls here are short. Functions that create no arrays, and whose callers hold the
# arrays, need not count.
_UNCOUNTED = {**_COMMON, "_nrt": False}


class _Listener(event.Listener):
    """Is notified when Numba compiles; functions from its cache are not compiled."""

    def on_start(self, _: event.Event) -> None:
        watch.begins()

    def on_end(self, _: event.Event) -> None:
        watch.ends()


event.register("numba:compile", _Listener())  # type: ignore[no-untyped-call]

jit = njit(**_UNCOUNTED)  # type: ignore[call-overload]
"""Decorator of compiled functions. A division by zero gives inf or nan, as NumPy's does. They
cannot create arrays: compiling one that does fails. Callers must pass writable arrays, since Numba
compiles everything once more for read-only ones.
"""

jit_inner = njit(  # type: ignore[call-overload]
    **_UNCOUNTED, no_cpython_wrapper=True, no_cfunc_wrapper=True
)
"""The same for functions that only compiled functions call: wrappers for calls from Python took a
fifth of the compile time.
"""

jit_lanes = njit(  # type: ignore[call-overload]
    **_UNCOUNTED, no_cpython_wrapper=True, no_cfunc_wrapper=True, fastmath={"contract"}
)
"""The same for loops over lanes, see seecr.compiled.lanes: products and sums may be fused."""

jit_merged = njit(  # type: ignore[call-overload]
    **_UNCOUNTED, no_cpython_wrapper=True, no_cfunc_wrapper=True, forceinline=True
)
"""The same for functions that are merged into their callers: to pass a dozen arrays took as long as
what is computed with them. Each call adds to the compile time.
"""

jit_pasted = njit(**_UNCOUNTED, inline="always")  # type: ignore[call-overload]
"""The same for functions with one caller or two: each becomes part of these, before they are
compiled, with their settings: it may create arrays where they may. By itself it would be optimised
with all that it calls, and once more in its caller.
"""

jit_allocating = njit(**_COMMON, _nrt=True)  # type: ignore[call-overload]
"""The same for functions that create arrays. It has to be explicit: otherwise the caller's setting
would apply.
"""

COMPILES = not config.DISABLE_JIT  # type: ignore[attr-defined]
"""Whether anything is compiled; else all of it is run by Python."""


def by_address(name, function):
    """What compiled functions call a function by that is compiled once, by itself.

    Numba compiles all that a function calls anew in it, and in all that call that. This one they
    call by its address, which the linker knows by ``name``: so they know neither what it does nor
    what shapes it expects.

    Args:
        name: for the linker, so that functions from numba's cache find it too.
        function: of addresses of numbers, which ``carray`` makes arrays of; it returns a bool.
    """
    kind = types.boolean(*[types.CPointer(types.float64)] * function.__code__.co_argcount)
    add_symbol(name, cfunc(kind, cache=True)(function).address)
    return types.ExternalFunction(name, kind)
