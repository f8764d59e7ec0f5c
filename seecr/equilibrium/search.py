"""From a setup to certified equilibria, by the compiled descent or by the paper's own searches."""

from __future__ import annotations

from seecr.effects.setup import Setup
from seecr.pose import Array
from seecr.statics import batch
from seecr.statics.solution import Solution, certify
from seecr.statics.starts import start_of
from seecr.statics.tables import assemble


def solve_setup(
    setup: Setup,
    method: str = "newton",
    start: Array | None = None,
    max_iterations: int = 400,
    threads: int | None = None,
) -> Solution:
    """Like :func:`seecr.solve`, for a setup as effects left it; its history is ignored."""
    tables = assemble(setup)
    first, values = start_of(setup.robot, tables, start)
    if method == "newton":
        found = batch.descend(tables, first, max_iterations, threads, values)
    else:
        from seecr.equilibrium.scipy_search import solve_with_scipy

        found = solve_with_scipy(setup, tables, method, first, max_iterations, values)
    return certify(setup.robot, tables, found)
