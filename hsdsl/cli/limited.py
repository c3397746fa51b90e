"""``--allow-path`` and ``--limit``: what every verb that reads models takes beside its own options."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from hsdsl.cli.console import WRONG_USAGE, report_usage
from hsdsl.errors import UsageError
from hsdsl.limits import DEFAULT, NUMBERS, Limits, applied
from hsdsl.names import did_you_mean

AllowPath = Annotated[
    list[Path] | None,
    typer.Option("--allow-path", metavar="FOLDER", help="Let models read data files from here too. May be repeated."),
]
Limit = Annotated[
    list[str] | None,
    typer.Option(
        "--limit",
        metavar="NAME=NUMBER",
        help=f"Let a model ask for more: {', '.join(NUMBERS[:-1])} or {NUMBERS[-1]}. May be repeated.",
    ),
]
_OPTIONS = {"allow_path": AllowPath, "limit": Limit}


def limited(verb: Callable[..., None]) -> Callable[..., None]:
    """Give a verb the two options, which are in force while it runs."""

    @functools.wraps(verb)
    def with_limits(*, allow_path: list[Path] | None, limit: list[str] | None, **options: Any) -> None:
        try:
            limits = as_limits(allow_path or [], limit or [])
        except UsageError as error:
            report_usage(error, bool(options.get("json")))
            raise typer.Exit(WRONG_USAGE) from None
        with applied(limits):
            verb(**options)

    own = inspect.signature(verb, eval_str=True)
    keyword = inspect.Parameter.KEYWORD_ONLY
    added = [inspect.Parameter(name, keyword, default=None, annotation=kind) for name, kind in _OPTIONS.items()]
    parameters = [*own.parameters.values(), *added]
    with_limits.__signature__ = own.replace(parameters=parameters)  # pyright: ignore[reportAttributeAccessIssue]
    with_limits.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return with_limits


def as_limits(folders: Sequence[Path], pairs: Sequence[str]) -> Limits:
    """Read limits as they are typed.

    Raises
    ------
    UsageError
        No such limit, no positive number, or no such folder.
    """
    numbers: dict[str, Any] = {}
    for pair in pairs:
        name, equals, value = (part.strip() for part in pair.partition("="))
        if name not in NUMBERS:
            raise UsageError(f"--limit wants NAME=NUMBER, and there is no limit '{name}'", did_you_mean(name, NUMBERS))
        try:
            numbers[name] = type(getattr(DEFAULT, name))(float(value))
        except (ValueError, OverflowError):
            raise UsageError(f"--limit {name}{equals}{value}: a number is wanted") from None
    for folder in folders:
        if not folder.is_dir():
            raise UsageError(f"--allow-path {folder}: there is no such folder")
    return Limits(**numbers, folders=tuple(folders))
