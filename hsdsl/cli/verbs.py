"""The verbs by name, each in a module of its name that is loaded when the verb is used."""

from __future__ import annotations

import os
import sys
from importlib import import_module

import click
from click.exceptions import Exit, NoSuchCommand

from hsdsl import __version__
from hsdsl.interrupts import INTERRUPTED, WORD
from hsdsl.names import visible

VERBS = ("run", "validate", "lint", "explain", "distance", "chart", "schema", "doctor")
COMPLETE = "_HSDSL_COMPLETE"  # set by a shell that completes a command line


class _Verbs(click.Group):
    """The group of all verbs."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in VERBS:
            return None
        return getattr(import_module(f"hsdsl.cli.{cmd_name}"), cmd_name)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args[0] not in VERBS and not ctx.resilient_parsing:
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


def obey(words: list[str]) -> int:
    """Do what a command line says and return the exit code."""
    if instruction := os.environ.get(COMPLETE):
        from click.shell_completion import shell_complete

        return shell_complete(app, {}, "hsdsl", COMPLETE, instruction)
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
        print(WORD, file=sys.stderr)
        return INTERRUPTED
    return 0
