"""Messages, errors, and progress on standard error and standard output."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hsdsl.base.errors import STEP_AND_TOLERANCE, Diagnostic, ModelError, UsageError
from hsdsl.base.names import counted, visible, visible_lines
from hsdsl.base.progress import Text, ticking

MODEL_ERRORS, WRONG_USAGE = 1, 2


class Visible:
    """A text stream on which hidden characters become visible: no output can steer a terminal."""

    def __init__(self, plain: Any) -> None:
        self.plain = plain

    def write(self, text: str) -> int:
        self.plain.write(visible_lines(text))
        return len(text)

    def writelines(self, texts: Iterable[str]) -> None:
        for text in texts:
            self.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.plain, name)


def prepare() -> None:
    """Make standard output and error visible streams that encode any name; open them where they were closed."""
    for name in ("stdout", "stderr"):
        stream: Any = getattr(sys, name)
        if stream is None:
            stream = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
        setattr(sys, name, stream if isinstance(stream, Visible) else Visible(stream))


def say(text: str) -> None:
    """Write a message of one line to standard error."""
    print(visible(text), file=sys.stderr)


def print_json(content: Any) -> None:
    """Print the one JSON object of ``--json``."""
    from hsdsl.analysis.report import dumps

    print(dumps(content))


def write_table(target: Path | None, text: Callable[[], str]) -> None:
    """Write a table where a file is given for it, and say so; a sidecar of an earlier one is no longer its own."""
    from hsdsl.analysis.store import forget_sidecar
    from hsdsl.base.atomic import replacing

    if target is not None:
        with replacing(target) as file:
            file.write(text().encode())
            forget_sidecar(target)
        say(f"wrote {target}")


def draw(found: Any, plot: Path | None) -> None:
    """Draw an answer where a file is given for its picture, and say so."""
    if plot is not None:
        found.plot(plot)
        say(f"wrote {plot}")


@contextmanager
def errors_reported(json: bool) -> Generator[None]:
    """Turn `ModelError` and `UsageError` into messages and exit codes."""
    from typer import Exit

    try:
        yield
    except ModelError as error:
        if json:
            from hsdsl.language.diagnose import as_json

            print_json(as_json(error.diagnostics))
        else:
            print_errors(error.diagnostics)
        contradiction = all(d.code == STEP_AND_TOLERANCE for d in error.diagnostics)
        raise Exit(WRONG_USAGE if contradiction else MODEL_ERRORS) from None
    except UsageError as error:
        report_usage(error, json)
        raise Exit(WRONG_USAGE) from None


def print_errors(errors: Sequence[Diagnostic]) -> None:
    """Print the errors of models as text."""
    from hsdsl.language.diagnose import render

    print("\n\n".join(map(render, errors)), f"\n{counted(len(errors), 'error')}", sep="\n", file=sys.stderr)


def usage_entry(error: UsageError, path: str | None = None) -> dict[str, Any]:
    """What is wrong with a request, as an error of ``--json``."""
    return {"code": None, "path": path, "line": None, "column": None, "message": str(error), "hint": error.hint}


def report_usage(error: UsageError, json: bool) -> None:
    """Print what is wrong with a request."""
    if json:
        print_json({"errors": [usage_entry(error)]})
    hint = f"\n  hint: {visible(error.hint)}" if error.hint else ""
    print(f"hsdsl: {visible(str(error))}{hint}", file=sys.stderr)


@contextmanager
def progress(quiet: bool = False) -> Generator[Callable[[Text], None] | None]:
    """Draw the latest text on one line of a terminal, from half a second on.

    Yields ``show(text)`` with ``text()`` called for each drawing, or None where nothing is drawn.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    with ticking(lambda text: _draw("\r\x1b[K" if text is None else f"\r{visible(text[:100])}\x1b[K")) as show:
        yield show


def _draw(text: str) -> None:
    """Write text with control characters to standard error."""
    plain = sys.stderr.plain if isinstance(sys.stderr, Visible) else sys.stderr
    plain.write(text)
    plain.flush()
