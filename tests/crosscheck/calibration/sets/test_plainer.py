"""Of sets that explain as well, the one that is easier to believe; and what a fit did not find."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_data import COGIRO, term

from crosscheck.calibration.joint_fit.linearised import Linear, left_to_gain
from crosscheck.calibration.sets.refits import plainer
from seecr.description.mjcf import load_robot
from seecr.effects import Term, catalogue, layout_of

ROBOT = load_robot(COGIRO)
BEHIND = term(ROBOT, "winch_side_length", length_m=0.3)
RUBS = term(ROBOT, "exit_friction", friction=0.1, length_m=0.3)
HEAVY = term(ROBOT, "platform_mass", added_kg=0.02)
# a hundred plausible sizes
ABSURD = Term(HEAVY.layout, HEAVY.layout.null + 100.0 * HEAVY.layout.scale)


def chosen(
    best: list[Term], others: list[tuple[float, list[Term]]], have: tuple[str, ...] = ()
) -> Any:
    """The names of what is taken: each other set costs so much ln evidence."""
    refits = [
        SimpleNamespace(
            names=frozenset(t.name for t in terms), score=-loss, joint=SimpleNamespace(terms=terms)
        )
        for loss, terms in [(0.0, best), *others]
    ]
    exact: Any = SimpleNamespace(
        plain=SimpleNamespace(terms=SimpleNamespace(names=have)),
        possible={refit.names: refit for refit in refits},
        catalogue=SimpleNamespace(
            start=lambda name: SimpleNamespace(layout=layout_of(catalogue()[name], ROBOT))
        ),
    )
    return plainer(exact, refits[0]).names  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("best", "others", "taken"),
    [
        ([RUBS], [(2.9, [BEHIND])], {"winch_side_length"}),
        ([RUBS], [(3.1, [BEHIND])], {"exit_friction"}),
        ([BEHIND], [(2.0, [RUBS])], {"winch_side_length"}),
        ([RUBS], [(2.0, [HEAVY])], {"exit_friction"}),
        ([ABSURD], [(2.0, [BEHIND]), (1.0, [RUBS])], {"exit_friction"}),
        ([RUBS], [(1.0, [ABSURD]), (2.0, [BEHIND])], {"winch_side_length"}),
        ([RUBS, HEAVY], [(1.0, [BEHIND, HEAVY])], {"winch_side_length", "platform_mass"}),
        ([RUBS, HEAVY], [(1.0, [BEHIND])], {"exit_friction", "platform_mass"}),
    ],
)
def test_a_contained_or_a_plausible_effect_is_taken_if_it_explains_as_well(
    best: list[Term], others: list[tuple[float, list[Term]]], taken: set[str]
) -> None:
    assert chosen(best, others) == taken


def test_what_the_model_has_already_may_be_of_any_size() -> None:
    assert chosen([ABSURD], [(1.0, [BEHIND])], have=("platform_mass",)) == {"platform_mass"}


def test_what_is_left_to_gain_is_the_fall_to_the_optimum_of_the_linear_model() -> None:
    rng = np.random.default_rng(1)
    x, z = rng.normal(size=(30, 4)), np.array([0.5, -1.0, 0.3, 2.0])
    width = np.array([1.0, 0.3, 0.0, 10.0])  # the third is held where it is
    x[:, 2] = 0.0
    linear = Linear(x, x @ z + rng.normal(size=30), width)

    def objective(at: np.ndarray) -> float:
        free = width > 0.0
        return float(np.sum((linear.y - x @ at) ** 2) + np.sum((at[free] / width[free]) ** 2))

    free = width > 0.0
    best = z.copy()
    best[free] = np.linalg.solve(
        x[:, free].T @ x[:, free] + np.diag(width[free] ** -2.0), x[:, free].T @ linear.y
    )
    assert left_to_gain(linear, best) == pytest.approx(0.0, abs=1e-9)
    off = best + np.array([0.1, -0.2, 0.0, 0.3])
    assert left_to_gain(linear, off) == pytest.approx(objective(off) - objective(best))
