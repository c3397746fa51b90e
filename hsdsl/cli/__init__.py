"""The command line: one short function a verb, no numerics.

Exit codes: 0 done, 1 the model has errors, 2 wrong usage or an unreadable file, 3 the run stopped before its end, 130
interrupted. Messages and progress go to standard error; with ``--json`` standard output carries one object and nothing
else.
"""

from __future__ import annotations

import os
import sys
from typing import Annotated, Any

import typer

from hsdsl import __version__
from hsdsl.cli.chart import chart
from hsdsl.cli.console import WRONG_USAGE
from hsdsl.cli.distance import distance
from hsdsl.cli.doctor import doctor
from hsdsl.cli.explain import explain
from hsdsl.cli.limited import limited
from hsdsl.cli.lint import lint
from hsdsl.cli.run import run
from hsdsl.cli.schema import schema
from hsdsl.cli.validate import validate

INTERRUPTED = 130
WrongWords: Any = typer.BadParameter.__mro__[2]  # ClickException, wherever typer has it from

app = typer.Typer(
    name="hsdsl",
    help="Hybrid systems written as mathematics in YAML: checked, simulated, measured.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
READING = (run, validate, lint, distance, chart)  # verbs that read models
for verb in (run, validate, lint, explain, distance, chart, schema, doctor):
    app.command()(limited(verb) if verb in READING else verb)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"hsdsl {__version__}")
        raise typer.Exit


@app.callback()
def _options(  # pyright: ignore[reportUnusedFunction]
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Run the command line (the ``hsdsl`` script)."""
    _prepare_streams()
    try:
        code = app(standalone_mode=False)
        sys.stdout.flush()  # a full disk shows here rather than when the interpreter ends
    except WrongWords as error:
        error.show()
        code = error.exit_code
    except (typer.Abort, KeyboardInterrupt):
        print("interrupted", file=sys.stderr)
        code = INTERRUPTED
    except (BrokenPipeError, SystemExit) as error:  # typer makes an exit of a broken pipe
        if not isinstance(error, BrokenPipeError) and not isinstance(error.__context__, BrokenPipeError):
            raise
        _drop_output()  # nobody reads: nothing left to say
        code = 0
    except OSError as error:
        _drop_output()
        print(f"hsdsl: the answer cannot be written: {error.strerror or error}", file=sys.stderr)
        code = WRONG_USAGE
    sys.exit(code or 0)


def _prepare_streams() -> None:
    """See to it that there are streams, also where they were closed, and that they can write any name."""
    for name in ("stdout", "stderr"):
        stream: Any = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def _drop_output() -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.__stdout__.fileno() if sys.__stdout__ else 1)
