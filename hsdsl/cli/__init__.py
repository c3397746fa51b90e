"""The command line: one short function a verb, no numerics.

Exit codes: 0 done, 1 the model has errors, 2 wrong usage or an unreadable file, 3 the run stopped before its end, 130
interrupted. Messages and progress go to standard error; with ``--json`` standard output carries one object and nothing
else.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module

import click
from click.exceptions import Exit, NoSuchCommand

from hsdsl import __version__
from hsdsl.cli import streams
from hsdsl.names import visible

INTERRUPTED, WRONG_USAGE = 130, 2
VERBS = ("run", "validate", "lint", "explain", "distance", "chart", "schema", "doctor")


class _Verbs(click.Group):
    """The verbs, each in a module of its name that is loaded when the verb is asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in VERBS:
            return None
        return getattr(import_module(f"hsdsl.cli.{cmd_name}"), cmd_name)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args[0] not in VERBS:
            raise NoSuchCommand(args[0], possibilities=VERBS, ctx=ctx)
        return super().resolve_command(ctx, args)


@click.group(
    cls=_Verbs,
    name="hsdsl",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True},
)
@click.version_option(__version__, message="%(prog)s %(version)s", prog_name="hsdsl", help="Print the version.")
def app() -> None:
    """Hybrid systems written as mathematics in YAML: checked, simulated, measured."""


def main() -> None:
    """Run the command line (the ``hsdsl`` script)."""
    streams.prepare()
    code = 0
    try:
        code = _obey(sys.argv[1:])
        sys.stdout.flush()  # a full disk shows here rather than when the interpreter ends
    except BrokenPipeError:
        _drop_output()  # nobody reads: nothing left to say
    except OSError as error:
        code = WRONG_USAGE
        _drop_output()
        print(f"hsdsl: the answer cannot be written: {error.strerror or error}", file=sys.stderr)
    sys.exit(code)


def _obey(words: list[str]) -> int:
    """Do what a command line says and return the exit code."""
    try:
        with app.make_context("hsdsl", words) as context:
            app.invoke(context)
    except Exit as end:
        return end.exit_code
    except click.ClickException as error:
        vars(error)["message"] = visible(error.message)
        error.show(sys.stderr)
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
    return 0


def _drop_output() -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.__stdout__.fileno() if sys.__stdout__ else 1)
