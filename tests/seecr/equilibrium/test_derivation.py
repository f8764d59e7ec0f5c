"""The paper's equations (5) and (6), derived with sympy: what is misprinted, and where 0/0 is."""

from __future__ import annotations

import pytest

sp = pytest.importorskip("sympy", reason="sympy is not installed: pip install '.[test]'")

px, py, a1x, a1y, a2x, a2y = sp.symbols("px py a1x a1y a2x a2y", real=True)
theta, h = sp.symbols("theta h", real=True)
X1, Y1, X2, Y2 = a1x - px, a1y - py, a2x - px, a2y - py
A, B = Y1 * X2 + Y2 * X1, 2 * X1 * X2

# The radicand of equation (6), term by term as the paper's text has it.
PRINTED = """4*px**4; -8*px**3*a1x; -8*px**3*a2x; 4*px**2*a1x**2; 16*px**2*a1x*a2x; 4*px**2*a2x**2;
4*px**2*py**2; -4*px**2*py*a1y; 6*px*a1x*py*a2y; -4*px**2*py*a2y; px**2*a1y**2; 2*px**2*a1y*a2y;
px**2*a2y**2; -8*px*a1x**2*a2x; -8*px*a1x*a2x**2; -4*px*a1x*px**2; -2*px*a1x*a2y**2;
-2*px*a1x*a1y*a2y; 2*px*a1x*py*a1y; -2*px*a2x*a1y*a2y; -4*px*a2x*py**2; 6*px*a2x*py*a1y;
a1x**2*py**2; 2*px*a2x*py*a2y; -2*px*a2x*a1y**2; 4*a1x**2*a2x**2; a1x**2*a2y**2;
2*a1x*a2x*px**2; -2*a1x**2*py*a2y; a2x**2*py**2; -2*a2x**2*py*a1y; a2x**2*a1y**2;
-2*a1x*a2x*py*a1y; -2*a1x*a2x*py*a2y; 2*a1x*a2x*a1y*a2y"""


def three_forces_meet() -> sp.Expr:
    """Zero where two cables can carry a bar of half length h: eqs (1) to (3) without tensions.

    The determinant of the wrenches (force x, force y, torque) of both cables along their lines,
    unnormalised, and of the weight.
    """
    ends = [(-h * sp.cos(theta), -h * sp.sin(theta)), (h * sp.cos(theta), h * sp.sin(theta))]
    lines = []
    for (bx, by), (x, y) in zip(ends, ((X1, Y1), (X2, Y2)), strict=True):
        fx, fy = x - bx, y - by
        lines.append([fx, fy, bx * fy - by * fx])
    return sp.Matrix([*lines, [0, -1, 0]]).det()


@pytest.mark.slow
def test_the_bars_equation_and_its_limit() -> None:
    # docs/misprints.md: h times this vanishes
    bar = (
        -2 * X1 * X2 * sp.sin(theta)
        + h * sp.sin(theta) * sp.cos(theta) * (X1 - X2)
        + sp.cos(theta) * (Y1 * X2 + Y2 * X1)
        + h * sp.cos(theta) ** 2 * (Y2 - Y1)
    )
    ratio = sp.simplify(three_forces_meet() / (h * bar))
    assert ratio in (1, -1)
    # h to 0: B sin(theta) = A cos(theta), which has no length of the bar in it
    limit = bar.subs(h, 0)
    assert sp.expand(limit - (A * sp.cos(theta) - B * sp.sin(theta))) == 0


@pytest.mark.slow
def test_equation_5_is_the_half_angle_of_that_limit_and_is_0_over_0_at_the_level_pose() -> None:
    root = sp.sqrt(A**2 + B**2)
    t = (B + root) / -A  # tan(theta / 2)
    assert sp.simplify(2 * t / (1 - t**2) - A / B) == 0
    # (5) as corrected is that, written out
    numerator = 2 * px**2 - 2 * px * (a1x + a2x) + 2 * a1x * a2x
    denominator = px * (a1y + a2y - 2 * py) + py * (a1x + a2x) - a1x * a2y - a2x * a1y
    assert sp.expand(numerator - B) == 0 and sp.expand(denominator + A) == 0
    # level: the platform between exit points of one height, in the middle
    level = {a1x: 0, a2x: 1, a1y: 1, a2y: 1, px: sp.Rational(1, 2), py: 0}
    assert A.subs(level) == 0 and (B + root).subs(level) == 0
    assert sp.atan(A / B).subs(level) == 0


def test_two_of_the_terms_of_equation_6_are_misprinted() -> None:
    # not added up: one of the misprints would hide in another term
    printed = [sp.sympify(term, locals=dict(px=px, py=py, a1x=a1x, a1y=a1y, a2x=a2x, a2y=a2y))
               for term in PRINTED.split(";")]  # fmt: skip
    true = set(sp.Add.make_args(sp.expand(A**2 + B**2)))
    assert len(printed) == len(true) == 35
    assert true - set(printed) == {-4 * px * a1x * py**2, 2 * a1x * a2x * py**2}
    assert set(printed) - true == {-4 * px**3 * a1x, 2 * a1x * a2x * px**2}
    mended = sum(printed) - 4 * px * a1x * (py**2 - px**2) + 2 * a1x * a2x * (py**2 - px**2)
    assert sp.expand(mended - A**2 - B**2) == 0


def test_what_the_misprints_of_equation_6_do_to_the_tilt() -> None:
    at = {a1x: 0.1, a1y: 1.3, a2x: 1.2, a2y: 1.1, px: 0.4, py: 0.6}
    printed = sp.sqrt(sp.sympify(PRINTED.replace(";", "+").replace("+ -", "-")))
    a, b = (float(one.subs({**at})) for one in (A, B))
    true = float(sp.deg(2 * sp.atan((b + sp.sqrt(a**2 + b**2)) / -a)))
    names = {str(symbol): value for symbol, value in at.items()}
    root = float(printed.subs({symbol: names[str(symbol)] for symbol in printed.free_symbols}))
    wrong = float(sp.deg(2 * sp.atan((b + root) / -a)))
    assert true == pytest.approx(-40.5, abs=0.05) and wrong == pytest.approx(-37.3, abs=0.05)
