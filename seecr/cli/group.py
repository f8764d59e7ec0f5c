"""A command line whose commands live in modules of their own, imported only when used."""

from __future__ import annotations

import gc
import os
import signal
import sys
import traceback
from collections.abc import Mapping
from importlib import import_module
from itertools import pairwise
from typing import Any, TypeAlias

import click

from seecr import SeecrError
from seecr.errors import printable
from seecr.version import full_version

CommandTable: TypeAlias = Mapping[str, tuple[str, str]]

BAD_INPUT = 2
ARGUMENTS = "seecr.arguments"
"""In a context's ``meta``: what the command line was called with, a list of words."""
_HELP = """\b
{} is an MJCF file, or the name of a shipped robot (demobot_cogiro, planar_vertical ...).
Exit status: 0 all well, 1 a threshold exceeded, 2 bad input or usage,
3 a solve did not converge, 70 a defect of the program: --debug, beside
any command, shows where."""
DEBUG = "--debug"
_DEFECT = 70
"""EX_SOFTWARE of sysexits.h: it is nobody's gate that failed, and no input that is wrong."""
_MOST = 300
"""Characters of an exception's text that are shown."""
# As a shell counts what SIGINT, SIGPIPE and SIGTERM end.
_INTERRUPTED, _CUT_OFF, _ENDED = 130, 141, 143


class LazyGroup(click.Group):
    """A command line that imports a command when it is called, and ends bad input in one line.

    Args:
        package: where the commands' modules are, in the package that the command is called as; each
            holds its own as ``command``.
        table: of each command its module and its line in ``--help``, in the order of the help.
        said: what the commands are for. robot: how their help calls the robot's file.
    """

    def __init__(self, package: str, table: CommandTable, said: str, robot: str) -> None:
        name = package.partition(".")[0]
        super().__init__(
            name,
            callback=click.pass_context(_show_help),
            help=f"{said}\n\n{_HELP.format(robot)}",
            invoke_without_command=True,
            context_settings={"help_option_names": ["-h", "--help"]},
            epilog=f"'{name} COMMAND --help' shows a command's options and examples.",
        )
        click.version_option(full_version(), prog_name=name)(self)
        self.package, self.table = package, table

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command and its words, none of them empty; no option for one file has two."""
        ctx.meta[ARGUMENTS] = list(args)
        name, command, words = super().resolve_command(ctx, args)
        _refuse_empty(words, ctx)
        if command is not None:
            own = click.Context(command, ctx, name)
            _refuse_taken(words, command, own)
            _refuse_repeated(words, command, own)
        return name, command, words

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order of the table."""
        return list(self.table)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command, imported."""
        if cmd_name not in self.table:
            return None
        module, line = self.table[cmd_name]
        command: click.Command = import_module(f"{self.package}.{module}").command
        command.short_help = line  # which completion in a shell shows
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in self.table.items()])

    def main(self, *args: Any, **extra: Any) -> Any:
        """Run; bad input is one line on standard error and status 2, never a traceback."""
        if not extra.pop("standalone_mode", True):
            return self._run(*args, **extra)
        if not args and extra.get("args") is None:  # as a program, not by Python
            # What a command loads and draws is up to 460,000 objects, few of them garbage: to look
            # for that as often as usual took an eighth of the time, and four times a twentieth.
            gc.set_threshold(500_000, 50, 100)
            # MuJoCo would look for a window and graphics, which takes a Python of its own
            os.environ.setdefault("MUJOCO_GL", "disable")
            signal.signal(signal.SIGTERM, _end)
        given = args[0] if args else extra.pop("args", None)
        words = sys.argv[1:] if given is None else list(given)
        debug = DEBUG in words
        try:
            status = self._run([word for word in words if word != DEBUG], *args[1:], **extra)
        except click.ClickException as error:
            sys.exit(self._refuse(_usage_text(error)))
        except SeecrError as error:
            sys.exit(self._refuse(str(error), error.exit_status))
        except SystemExit as done:
            if done.code == _ENDED:
                self._refuse("ended by SIGTERM")
            # click ends 1 when whoever read our output has left; here 1 means something else
            sys.exit(_CUT_OFF if done.code == 1 else done.code)
        except OSError as error:
            sys.exit(self._refuse(f"{error.filename or 'file'}: {error.strerror or error}"))
        except (click.Abort, KeyboardInterrupt):
            sys.exit(self._refuse("interrupted", _INTERRUPTED))
        except Exception as error:
            if debug:
                traceback.print_exc()
            sys.exit(self._refuse(self._defect(error), _DEFECT))
        sys.exit(status if isinstance(status, int) else 0)

    def _defect(self, error: Exception) -> str:
        """What to say of an exception that nobody foresaw."""
        own, what = f"{self.name} {full_version()}", f"{type(error).__name__}: {error}"[:_MOST]
        return (
            f"a defect of {own}, not of your input: {what}; please report it "
            f"with the command and what {DEBUG} shows (CONTRIBUTING.md)"
        )

    def _refuse(self, text: str, status: int = BAD_INPUT) -> int:
        for line in text.splitlines():  # several faults of one file are a line each
            words = printable(" ".join(line.split()))
            click.echo(
                f"  {words}" if words.startswith("- ") else f"{self.name}: {words}", err=True
            )
        return status

    def _run(self, *args: Any, **extra: Any) -> Any:
        # click's overloads tell its two modes apart by a literal that *args hides
        return super().main(*args, standalone_mode=False, **extra)  # type: ignore[call-overload]


def _show_help(ctx: click.Context) -> None:
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())


def _end(_signal: int, _frame: object) -> None:
    """End as an error does, so that unfinished results are removed."""
    raise SystemExit(_ENDED)


def _refuse_empty(words: list[str], ctx: click.Context) -> None:
    """Refuse words without a letter, as an unset variable of a shell leaves them."""
    for before, word in pairwise(["", *words]):
        name, equals, value = word.partition("=")
        if equals and name.startswith("--") and not value.strip():
            raise click.UsageError(f"{name}: expected a value, got none; leave it out", ctx)
        if not word.strip():
            where = f"{before}: " if before.startswith("-") else ""
            raise click.UsageError(f"{where}expected a value, got an empty one; leave it out", ctx)


def _refuse_taken(words: list[str], command: click.Command, ctx: click.Context) -> None:
    """Refuse an option too few values, before click takes the options after it for values."""
    options = {o: one for one in command.params if isinstance(one, click.Option) for o in one.opts}
    for k, word in enumerate(words):
        one = options.get(word)
        # flags have no value, and where there is one for want of any it may be left out
        if one is None or one.is_flag or isinstance(one.flag_value, str):
            continue
        for value in words[k + 1 : k + 1 + one.nargs]:
            if value in options:
                raise click.UsageError(f"{word}: expected {one.metavar}, got {value}", ctx)


def _refuse_repeated(words: list[str], command: click.Command, ctx: click.Context) -> None:
    """Refuse several files where one is expected: click would take the last, and say nothing.

    Numbers may be repeated, as an alias of a shell and what is typed after it do.
    """
    ctx.ignore_unknown_options = True  # such as negative numbers
    try:
        _values, _rest, order = command.make_parser(ctx).parse_args(list(words))
    except click.UsageError:
        return  # the command itself refuses it, in the order of its own checks
    options = [one for one in command.params if isinstance(one, click.Option)]
    for option in options:
        times = sum(given is option for given in order)
        if isinstance(option.type, click.Path) and not option.multiple and times > 1:
            raise click.UsageError(
                f"{option.opts[0]}: expected once, got {times} times; leave out all but one", ctx
            )


def _usage_text(error: click.ClickException) -> str:
    context = getattr(error, "ctx", None)
    hint = f" (see {context.command_path} --help)" if context is not None else ""
    return f"{error.format_message()}{hint}"
