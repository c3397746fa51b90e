"""Texts of options as values: names, pairs of names, limits, and files that can be written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from hsdsl.base.errors import UsageError
from hsdsl.base.limits import DEFAULT, NUMBERS, Limits
from hsdsl.base.names import did_you_mean

STATE = "state or output "
PICTURES = (".png", ".svg")


def limit_options(folders: Sequence[Path], pairs: Sequence[str]) -> Limits:
    """Read ``--allow-path`` and ``--limit``.

    Raises UsageError: no such limit, no positive number, or no such folder.
    """
    numbers: dict[str, Any] = {}
    for pair in pairs:
        name, _, value = (part.strip() for part in pair.partition("="))
        if name not in NUMBERS:
            raise UsageError(f"--limit: expected NAME=NUMBER, got '{pair}'", did_you_mean(name, NUMBERS))
        try:
            numbers[name] = type(getattr(DEFAULT, name))(float(value))
        except (ValueError, OverflowError):
            raise UsageError(f"--limit {name}: expected a number, got '{value}'") from None
    for folder in folders:
        if not folder.is_dir():
            raise UsageError(f"--allow-path {folder}: there is no such folder")
    return Limits(**numbers, folders=tuple(folders))


def names_of(text: str | None) -> list[str]:
    """The names in a text with commas between them."""
    return [part.strip() for part in (text or "").split(",") if part.strip()]


def known_names(
    text: str | None, known: Sequence[str], name: str, kind: str = "", inputs: Sequence[str] = ()
) -> tuple[str, ...]:
    """The names in a text with commas between them; ``kind`` says in an error what they name, and ``inputs`` do not.

    Raises UsageError: one of them is not known.
    """
    names = names_of(text)
    for each in names:
        if each not in known:
            given = f"it is an input: write outputs: {{{each}: {each}}}" if each in inputs else None
            raise UsageError(f"{name}: there is no {kind}'{each}'", given or did_you_mean(each, known))
    return tuple(names)


def pairs_of(texts: list[str] | None, known: Sequence[str]) -> list[tuple[str, str]] | None:
    """Read ``--phase``; None where it is left out.

    Raises UsageError: no pair, or no such state or output.
    """
    pairs: list[tuple[str, str]] = []
    for text in texts or ():
        if text.count(",") != 1 or len(names_of(text)) != 2:
            raise UsageError(f"--phase: expected two names with a comma between them, got '{text}'")
        first, second = known_names(text, known, "--phase", STATE)
        pairs.append((first, second))
    return pairs or None


def check_target(
    path: Path | None,
    option: str,
    suffixes: Sequence[str] = PICTURES,
    others: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> None:
    """Refuse a file that could not be written before a long run, not after it.

    ``others`` has the suffixes of the files that other options of the verb write.
    """
    if path is None:
        return
    if path.suffix.lower() not in suffixes:
        known = " or ".join(filter(None, (", ".join(suffixes[:-1]), suffixes[-1])))
        meant = next((name for name, own in others.items() if path.suffix.lower() in own), None)
        raise UsageError(f"{option} {path}: the name must end in {known}", meant and f"{meant} {path} writes that")
    if not path.parent.is_dir():
        raise UsageError(f"{option} {path}: there is no folder {path.parent}")
    if path.suffix.lower() == ".parquet":
        from hsdsl.engine.execution.samples import optional

        optional("pyarrow", f"{option} {path}")
