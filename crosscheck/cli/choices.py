"""Options of the commands that compare a model with measurements."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import click

from seecr.cli.options import FILE


def listed(ctx: click.Context, param: click.Parameter, texts: Sequence[str]) -> tuple[str, ...]:
    """Words of an option that may be repeated and holds several between commas; its callback."""
    words = [[word.strip() for word in text.split(",") if word.strip()] for text in texts]
    for text, found in zip(texts, words, strict=True):
        if not found:
            raise click.BadParameter(f"expected {param.metavar}, got {text!r}.", ctx, param)
    return tuple(word for found in words for word in found)


sigma_option = click.option(
    "--sigma",
    "sigmas",
    multiple=True,
    metavar="KIND=0.1mm",
    help="Noise of a kind of reading (position, orientation, tension) or of the commanded lengths "
    "(length); may be repeated; overrides [sigma] in the TOML.",
)
"""``--sigma position=0.1mm``, given to the command as ``sigmas``, a tuple of texts."""

only_option = click.option(
    "--only",
    multiple=True,
    callback=listed,
    metavar="EFFECT,...",
    help="Consider only these effects, in addition to those of the model; may be repeated.",
)
"""``--only EFFECT,...``, given to the command as ``only``, a tuple of names."""

exclude_option = click.option(
    "--exclude",
    multiple=True,
    callback=listed,
    metavar="EFFECT,...",
    help="Do not consider these effects.",
)
"""``--exclude EFFECT,...``, given to the command as ``exclude``, a tuple of names."""


def check_effects(*names: Sequence[str]) -> None:
    """Check that there are effects of all these names.

    Raises:
        InputError: there is none of a name; the known ones are listed, nearest first.
    """
    from seecr import effect_named

    for name in (name for some in names for name in some):
        effect_named(name)


grown_model_option = click.option(
    "--model",
    type=FILE,
    required=True,
    metavar="M.toml",
    help="The model; created if it does not exist.",
)
"""``--model M.toml`` of commands that add to a model, given to the command as ``model``."""

tolerance_option = click.option(
    "--tolerance",
    "tolerances",
    multiple=True,
    metavar="0.1mm",
    help="Unexplained errors beyond the noise matter from this rms size on, such as 0.1mm, "
    "0.05deg or 1N; may be repeated.  [default: half the noise]",
)
"""``--tolerance 0.1mm``, given to the command as ``tolerances``, a tuple of texts."""


figures_option = click.option(
    "--figures", type=FILE, metavar="DIR", help="Folder for the page's figures, as SVG and PNG."
)
"""``--figures DIR``, given to the command as ``figures``; see :func:`figures_in`."""


@contextmanager
def figures_in(folder: Path | None) -> Iterator[None]:
    """Figures that are drawn meanwhile are kept there, if anywhere; all of them or none."""
    if folder is None:
        yield
        return
    from crosscheck.show.figures import keeping
    from seecr.files import staged

    with staged(folder, "--figures") as unfinished, keeping(unfinished):
        yield


@contextmanager
def result_in(out: Path | None, name: str) -> Iterator[Callable[[str], None]]:
    """A function that keeps a result's text in a folder, if any; it is tried before the work."""
    from seecr.files import staged, write_text

    if out is None:
        yield lambda _text: None
        return
    with staged(out) as folder:
        yield lambda text: write_text(folder / name, text + "\n")
