"""What the verbs share in speaking: errors in both forms, and progress on a terminal."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.exceptions import Exit

from hsdsl.cli.streams import draw
from hsdsl.errors import STEP_AND_TOLERANCE, ModelError, UsageError
from hsdsl.names import visible

if TYPE_CHECKING:
    from hsdsl.simulate.recorder import Progress

MODEL_ERRORS, WRONG_USAGE = 1, 2
FILE = click.Path(path_type=Path)
FIRST_SIGN, INTERVAL = 0.5, 0.2  # seconds


def say(text: str) -> None:
    """Write a message to standard error: one line, whatever stands in it."""
    say_lines(visible(text))


def say_lines(text: str) -> None:
    """Write several lines to standard error; what stands in each was made visible before."""
    print(text, file=sys.stderr)


@contextmanager
def errors_reported(json: bool) -> Generator[None]:
    """Turn the two exceptions of the house into messages and exit codes; never a traceback for bad input."""
    try:
        yield
    except ModelError as error:
        from hsdsl.diagnose import as_json, render
        from hsdsl.report import dumps

        if json:
            print(dumps(as_json(error.diagnostics)))
        else:
            say_lines("\n\n".join(render(d) for d in error.diagnostics))
            count = len(error.diagnostics)
            say_lines(f"\n{count} error{'s' * (count > 1)}")
        contradiction = all(d.code == STEP_AND_TOLERANCE for d in error.diagnostics)
        raise Exit(WRONG_USAGE if contradiction else MODEL_ERRORS) from None
    except UsageError as error:
        report_usage(error, json)
        raise Exit(WRONG_USAGE) from None


def report_usage(error: UsageError, json: bool) -> None:
    """Say what is wrong with a request."""
    if json:
        from hsdsl.report import dumps

        empty = {"code": None, "path": None, "line": None, "column": None}
        print(dumps({"errors": [{**empty, "message": str(error), "hint": error.hint}]}))
    say_lines(f"hsdsl: {visible(str(error))}" + (f"\n  hint: {visible(error.hint)}" if error.hint else ""))


@contextmanager
def progress(quiet: bool) -> Generator[Callable[[Progress], None] | None]:
    """Show how far a run is, on a terminal, once it takes longer than a moment. Yields the run's ``watch``."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    watched: list[Progress] = []
    done = threading.Event()

    def show() -> None:
        wait = FIRST_SIGN
        while not done.wait(wait):
            wait = INTERVAL
            for recorder in watched:
                _bar(float(recorder.now / recorder.until) if recorder.until else 1.0, recorder.made)

    thread = threading.Thread(target=show, daemon=True)
    thread.start()
    try:
        yield watched.append
    finally:
        done.set()
        thread.join()
        draw("\r\x1b[K")


def _bar(share: float, transitions: int, width: int = 30) -> None:
    full = round(width * min(1.0, share))
    draw(f"\r[{'=' * full}{' ' * (width - full)}] {share:4.0%}, {transitions} transitions\x1b[K")
