"""``--allow-path`` and ``--limit``: what every verb that reads models takes beside its own options."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click
from click.exceptions import Exit

from hsdsl.cli.console import FILE, WRONG_USAGE, report_usage
from hsdsl.errors import UsageError
from hsdsl.limits import DEFAULT, NUMBERS, Limits, applied
from hsdsl.names import did_you_mean


def limited(verb: Callable[..., None]) -> Callable[..., None]:
    """Give a verb the two options, which are in force while it runs."""

    @click.option(
        "--allow-path",
        type=FILE,
        multiple=True,
        metavar="FOLDER",
        help="Let models read data files from here too. May be repeated.",
    )
    @click.option(
        "--limit",
        multiple=True,
        metavar="NAME=NUMBER",
        help=f"Let a model ask for more: {', '.join(NUMBERS[:-1])} or {NUMBERS[-1]}. May be repeated.",
    )
    @functools.wraps(verb)
    def with_limits(*, allow_path: tuple[Path, ...], limit: tuple[str, ...], **options: Any) -> None:
        try:
            limits = as_limits(allow_path, limit)
        except UsageError as error:
            report_usage(error, bool(options.get("json")))
            raise Exit(WRONG_USAGE) from None
        with applied(limits):
            verb(**options)

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
