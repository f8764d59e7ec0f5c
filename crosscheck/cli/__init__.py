"""The command line. Each command lives in its own module, imported only when it is used."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Any

import click

from seecr import SeecrError, __version__

# Command, module in crosscheck.cli that holds it as `command`, and its line in --help.
COMMANDS: dict[str, tuple[str, str]] = {
    "run": ("run", "Settle every shipped robot in MuJoCo, solve it with SEECR, compare."),
    "compare": ("compare", "Hold a model against measurements."),
    "diagnose": ("diagnose", "Find which effects a model misses, from measurements."),
    "plan": ("plan", "Before measuring: what planned poses will be able to show."),
    "add": ("add", "Fit an effect to measurements and add it to a model."),
    "calibrate": ("calibrate", "Fit all effects at once to measurements, for predicting."),
    "twin": ("twin", "Make measurements with a hidden effect, MuJoCo being the truth."),
}

BAD_INPUT = 2
# As a shell counts what SIGINT and SIGPIPE end.
_INTERRUPTED, _CUT_OFF = 130, 141


class LazyGroup(click.Group):
    """A group that imports a command when it is called, and ends bad input in one line."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order of :data:`COMMANDS`."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command, imported."""
        if cmd_name not in COMMANDS:
            return None
        module = import_module(f"crosscheck.cli.{COMMANDS[cmd_name][0]}")
        command: click.Command = module.command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])

    def main(self, *args: Any, **extra: Any) -> Any:
        """Run; bad input is one line on standard error and status 2, never a traceback."""
        if not extra.pop("standalone_mode", True):
            return self._run(*args, **extra)
        try:
            status = self._run(*args, **extra)
        except click.ClickException as error:
            sys.exit(_refuse(_usage_text(error)))
        except SeecrError as error:
            sys.exit(_refuse(str(error), error.exit_status))
        except SystemExit as done:
            # click ends 1 when whoever read our output has left; here 1 means something else
            sys.exit(_CUT_OFF if done.code == 1 else done.code)
        except OSError as error:
            sys.exit(_refuse(f"{error.filename or 'file'}: {error.strerror or error}"))
        except (click.Abort, KeyboardInterrupt):
            sys.exit(_refuse("interrupted", _INTERRUPTED))
        sys.exit(status if isinstance(status, int) else 0)

    def _run(self, *args: Any, **extra: Any) -> Any:
        # click's overloads tell its two modes apart by a literal that *args hides
        return super().main(*args, standalone_mode=False, **extra)  # type: ignore[call-overload]


def _usage_text(error: click.ClickException) -> str:
    context = getattr(error, "ctx", None)
    hint = f" (see {context.command_path} --help)" if context is not None else ""
    return f"{error.format_message()}{hint}"


def _refuse(text: str, status: int = BAD_INPUT) -> int:
    click.echo(f"crosscheck: {' '.join(text.split())}", err=True)
    return status


@click.group(
    cls=LazyGroup,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="'crosscheck COMMAND --help' shows a command's options and examples.",
)
@click.version_option(__version__, prog_name="crosscheck")
@click.pass_context
def main(ctx: click.Context) -> None:
    """Hold the statics of a cable-driven parallel robot against MuJoCo and against measurements.

    \b
    Exit status: 0 all well, 1 a threshold exceeded, 2 bad input or usage,
    3 a solve did not converge.
    """
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())
