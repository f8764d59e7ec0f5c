"""What a comparison concludes, in one sentence.

Residuals look random only if neighbours are not correlated and they depend on nothing that was
tested. They may then be noise that was stated somewhat too small, but hardly many times too small.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from crosscheck.comparison.associations import Association
from crosscheck.comparison.quantities import QuantityKind
from crosscheck.fit.noise.whiteness import Whiteness

# Noise is hardly so many times what is stated. A kind of reading is at its noise up to _AT_NOISE
# times it, if another is far off.
_HARDLY, _AT_NOISE = 3.0, 1.5


def noise_sentence(white: Whiteness, known_as: str, associations: Sequence[Association]) -> str:
    """That white residuals are noise, and what they depend on all the same.

    Args:
        white: tests of the residuals. known_as: how the noise is known, "stated" or "estimated".
        associations: what the residuals are associated with, the strongest first.
    """
    goes = _goes_with(associations)
    but = f", but {goes}" if goes else ""
    times = f"{white.scale:.2f} times the {known_as} noise"
    return f"Model and data agree: the residuals are noise ({times}){but}."


def coloured_sentence(noise: str, is_open: bool) -> str:
    """That residuals are autocorrelated noise or noise with outliers, or may be.

    Args:
        noise: its size and correlation in words. is_open: whether its size was not stated, so that
            something that the model misses would look the same.
    """
    if not is_open:
        return f"Model and data agree: the residuals are noise ({noise})."
    return (
        f"The residuals may be noise ({noise}), but as its size was not stated, they may as well "
        "be something that the model misses and that varies as smoothly: state the noise."
    )


def misfit_sentence(
    white: Whiteness,
    times: Mapping[str, float],
    known_as: str,
    associations: Sequence[Association],
) -> str:
    """That residuals are no noise of the stated size, and what they look like.

    Args:
        white: tests of the residuals. times: their rms over the noise, by kind of reading.
        known_as: how the noise is known, "stated" or "estimated".
        associations: what the residuals are associated with, the strongest first.
    """
    size, goes = error_size_words(white.scale, times), _goes_with(associations)
    end = f"; {goes}" if goes else ""
    if white.structured:
        return f"The model misses something: {size} and correlated between neighbouring rows{end}."
    if goes:
        return f"The model misses something: {size}{end}."
    most = max(times.values())
    if most <= _HARDLY:
        return (
            f"The residuals look random, but {size}: either it is {known_as} too small, or many "
            "small effects are missing."
        )
    return (
        f"The model misses something, or the noise is {known_as} {most:.3g} times too small: "
        f"{size}, and depend on nothing that was tested."
    )


def error_size_words(scale: float, times: Mapping[str, float]) -> str:
    """How large errors are; which kinds of reading, if others are at their noise."""
    far = {kind: value for kind, value in times.items() if value > _AT_NOISE}
    near = [kind for kind in times if kind not in far]
    if not (far and near):
        return f"the errors are {scale:.3g} times the noise"
    own = " and ".join(far)
    sizes = " and ".join(f"{value:.3g}" for value in far.values())
    return (
        f"the errors of {own} are {sizes} times the noise (those of {' and '.join(near)} are noise)"
    )


def _goes_with(associations: Sequence[Association]) -> str:
    """What the errors depend on most, as a clause; "" if on nothing that was tested."""
    strongest = next((a for a in associations if a.significant), None)
    if strongest is None:
        return ""
    share = f"{100 * strongest.share:.0f} %"
    if strongest.kind is QuantityKind.EVERYWHERE:
        return f"{share} of their mean square is a constant offset"
    return f"{strongest.against} explains {share} of their variance"
