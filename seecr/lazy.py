"""Names of a package that are imported on first use."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from importlib import import_module
from typing import Any

_pictured: dict[str, str] = {}


def pictured(package: str, module: str) -> None:
    """Declare which module of a package has the ``PICTURES`` of its results, by their class.

    Results stand on a low floor, and what draws them on the highest: a package's face, which stands
    on all floors, brings them together.
    """
    _pictured[package] = f"{package}.{module}"


def pictures_of(kind: type) -> Any:
    """What draws results of a class; None if nothing does."""
    for one in kind.__mro__:
        module = _pictured.get(one.__module__.partition(".")[0])
        if module is not None and one in (table := import_module(module).PICTURES):
            return table[one]
    return None


def lazily(
    package: str, where: Mapping[str, str], modules: Collection[str] = ()
) -> Callable[[str], Any]:
    """The package's ``__getattr__``: public names, each with the module that defines it, and
    modules that are themselves available by name.
    """

    def get(name: str) -> Any:
        if name in modules:
            return import_module(f"{package}.{name}")
        if name not in where:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{where[name]}"), name)

    return get
