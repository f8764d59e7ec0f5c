"""How commands, their options and their progress are declared: what all commands share."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from seecr.cli.following import STDIN, introduce_all, keep_passive
from seecr.cli.group import ARGUMENTS

if TYPE_CHECKING:
    pass

F = TypeVar("F", bound=Callable[..., Any])

# A number below zero, or an axis of a grid that begins with one.
_NUMBER = re.compile(r"-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?(:.*)?")


class _Told(click.ParamType):  # type: ignore[type-arg]
    """A number; what is none, or outside its range, is told what was expected."""

    kind: str

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"expected {self.kind}{_within(self)}, got {value!r}.", param, ctx)


class WholeNumber(_Told, click.IntRange):
    """A whole number in a range."""

    kind = "a whole number"


class Number(_Told, click.FloatRange):
    """A number in a range."""

    kind = "a number"

    def _describe_range(self) -> str:
        """The range in the help; click describes one without ends as x<=None."""
        return "" if self.min is None and self.max is None else super()._describe_range()


def _within(numbers: Any) -> str:
    """A range in words, with a space before; nothing if there is none."""
    low, high = numbers.min, numbers.max
    if low is None:
        return "" if high is None else f" of at most {high:g}"
    least = f"above {low:g}" if numbers.min_open else f"of at least {low:g}"
    return f" {least}" if high is None else f" {least} and at most {high:g}"


class _File(click.Path):
    """A path; ``-`` is standard input, as everywhere."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        return super().convert(STDIN if value == "-" else value, param, ctx)


_PATHS = ("DIR", "FILE", ".toml", ".xml", ".csv", ".json")

FILE = _File(path_type=Path)
"""A file that the command itself opens, so that the error is its own."""


class NumbersCommand(click.Command):
    """A command whose negative numbers are values, not options."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Let negative numbers pass as arguments; refuse other unknown options as ever."""
        known = {name for p in self.get_params(ctx) for name in (*p.opts, *p.secondary_opts)}
        for arg in args[: args.index("--") if "--" in args else None]:
            name = arg.partition("=")[0]
            is_option = len(arg) > 1 and arg.startswith("-") and not _NUMBER.fullmatch(arg)
            if is_option and name not in known:
                near = difflib.get_close_matches(name, known, n=3)
                raise click.NoSuchOption(name, possibilities=near, ctx=ctx)
        ctx.ignore_unknown_options = True
        return super().parse_args(ctx, args)


def command(
    *examples: str, cls: type[click.Command] = click.Command
) -> Callable[[Callable[..., int]], click.Command]:
    """A decorator that makes a command whose help ends with these examples."""
    epilog = "\n  ".join(["\b\nExamples:", *examples])
    return click.command(cls=cls, epilog=epilog)


def option(
    words: str, said: str, kind: click.ParamType[Any] | None = None, name: str | None = None,
    **more: Any,
) -> Callable[[F], F]:  # fmt: skip
    """An option, as the help shows it: ``--count N``, ``--line X Y Z``, ``--up [y|z]``, ``--list``.

    Args:
        words: the option, with a word for each of its values, or none for a flag. Values in
            brackets are those it can have; ``DIR``, ``FILE`` or ``M.toml`` is a path.
        said: its help. kind: of other values than words and paths.
        name: of the command's argument, if it is another. more: for click.
    """
    option, *values = words.split()
    names = (option,) if name is None else (option, name)
    if not values:
        return click.option(*names, is_flag=True, help=said, **more)
    metavar = " ".join(values)
    if metavar.startswith("["):
        kind = click.Choice(metavar.strip("[]").split("|"))
    elif metavar.endswith(_PATHS):
        kind = FILE
    shown = {"show_default": "default" in more, **more}
    return click.option(*names, type=kind, nargs=len(values), metavar=metavar, help=said, **shown)


def out(default: str) -> Callable[[F], F]:
    """``--out DIR``, a folder for several files."""
    return option(
        "--out DIR",
        "Folder for the results; created if it does not exist. Older results there are replaced.",
        default=default,
    )


def out_file(file: str) -> Callable[[F], F]:
    """``--out DIR`` for this file alone, None without."""
    return option("--out DIR", f"Folder for {file}.  [default: none]")


def together(*declared: Callable[[Any], Any]) -> Callable[[F], F]:
    """Several arguments and options, in the order of the help."""

    def declare(function: F) -> F:
        for one in reversed(declared):
            function = one(function)
        return function

    return declare


def _fix(ctx: click.Context, _option: click.Parameter, out: Path | None) -> None:
    """Write the robot mended and end; whatever else the command needs is not asked for."""
    if out is None or ctx.resilient_parsing:
        return
    from seecr.description.fixing import told, write_fixed

    words = ctx.meta.get(ARGUMENTS, [])[1:]
    values, _rest, _order = ctx.command.make_parser(ctx).parse_args(list(words))
    given = values.get("robot")
    others = [one for one in words if one.endswith(".xml") and Path(one) != out]
    robot = Path(given) if given else next(map(Path, others), None)
    if robot is None:
        raise click.UsageError("--fix: expected ROBOT.xml, the robot to mend, got none", ctx)
    click.echo("\n".join(told(robot, out, write_fixed(robot, out))))
    ctx.exit(0)


fix = option(
    "--fix OUT.xml",
    "Write ROBOT into a new file, with what keeps it from being read mended where possible, tell "
    "what changed, and end.",
    is_eager=True, expose_value=False, callback=_fix,
)  # fmt: skip
as_json = option(
    "--json", "Print the result as JSON on standard output, and nothing else there.", name="as_json"
)
no_recording = option("--no-recording", "Do not write a recording (.rrd).")
pictures = together(
    option("--figure [png|svg|none]", "File type of the figure.", default="png"), no_recording
)


def _introduced(_ctx: click.Context, _param: click.Parameter, texts: tuple[str, ...]) -> None:
    """Effects of the user's own files, made part of the catalogue; the option's callback."""
    introduce_all(texts)


own_effects = option(
    "--effect FILE.py:CLASS",
    "An effect of your own: a class in a file, which is run; may be repeated. It is then one of "
    "the catalogue.",
    multiple=True,
    expose_value=False,
    callback=_introduced,
)


def words_option(words: str, said: str, **more: Any) -> Callable[[F], F]:
    """An option that may be repeated and holds several words between commas, as a tuple."""
    return option(words, said, multiple=True, **{"callback": words_of, **more})


def words_of(ctx: click.Context, param: click.Parameter, texts: Sequence[str]) -> tuple[str, ...]:
    """The words of an option that may be repeated and holds several between commas."""
    words = [[word.strip() for word in text.split(",") if word.strip()] for text in texts]
    for text, found in zip(texts, words, strict=True):
        if not found:
            raise click.BadParameter(f"expected {param.metavar}, got {text!r}.", ctx, param)
    return tuple(word for found in words for word in found)


def _keep_passive(ctx: click.Context, param: click.Parameter, texts: Sequence[str]) -> None:
    keep_passive(ctx, words_of(ctx, param, texts))


passive = words_option(
    "--passive LINE,...",
    "Lines that no winch drives (bands, springs), besides those that the robot's file names; may "
    "be repeated.",
    callback=_keep_passive,
    expose_value=False,
)
robot = together(
    click.argument("robot", type=FILE, metavar="ROBOT"),
    passive,
    option(
        "--cable NAME|N",
        "k_c = E S of all cables, instead of that in the robot's file: vectran, fishing, a rope "
        "such as 'steel 7x19 3mm', or a number [N].",
    ),
    option("--model M.toml", "Model file with the robot's effects.  [default: plain SEECR]"),
    own_effects,
    fix,
)
limits = together(
    option("--lowest N", "Lowest allowed tension of every cable [N].", Number(), default=0.0),
    option("--highest N", "Highest allowed tension of every cable [N].", Number()),
)


def _renamed(ctx: click.Context, _option: click.Parameter, value: str | None) -> None:
    """``--columns`` holds for all files that the command reads."""
    if value is not None:
        from seecr.columns.headers import parse_columns, renamed

        ctx.with_resource(renamed(parse_columns(value)))


columns = option(
    "--columns THEIRS=OURS,...",
    "What headers of other programs stand for, such as px=meas_x_m; one * on each side stands for "
    "the same text: L*=length_*_m. Also [columns] in the TOML.",
    expose_value=False,
    callback=_renamed,
)


def turned(of: str) -> Callable[[F], F]:
    """``--turned``, the orientation ``of`` what it is said to be of."""
    said = f"Orientation of {of}.  [default: that of the reference pose]"
    return option("--turned QW QX QY QZ", said, Number(), callback=_unit_turn)


def _unit_turn(
    _ctx: click.Context, _option: click.Parameter, value: tuple[float, ...] | None
) -> tuple[float, ...] | None:
    """``--turned`` as given, if it is a rotation."""
    if value is not None:
        from seecr.cli.arguments import check_unit

        check_unit("--turned", value)
    return value


def check_finite(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    """A number as it is, as an option's callback; a usage error where it is none, or has no end."""
    if value is not None and not math.isfinite(value):
        raise click.BadParameter(f"{value} is not a finite number.", ctx, param)
    return value


scheduler = option(
    "--scheduler ADDRESS",
    "The workers of this scheduler of dask.distributed do the work; needs seecr[cluster].",
)
