"""Findings remedied in the file itself: one round of edits after the other, each checked before the next."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import Any

from hsdsl.analysis.lint import Report, lint
from hsdsl.base.atomic import replacing
from hsdsl.base.errors import Edit, ModelError, UsageError
from hsdsl.language.files import is_piped, read_bytes
from hsdsl.language.source import decode
from hsdsl.language.system import HybridSystem

_MOST_ROUNDS = 100
_MARK = b"\xef\xbb\xbf"


def fix(path: str | os.PathLike[str], selection: Sequence[str] | None = None) -> tuple[Report, int]:
    """Remedy what rules know to remedy, and look again.

    A new file replaces the old one, once, and only if something has changed. Edits after which the model would
    have errors or another meaning are not made.

    Returns
    -------
    Report
        What is still found.
    int
        How many findings were remedied.

    Raises ModelError: the model has errors.
    Raises UsageError: the file cannot be read or written.
    """
    original = data = read_bytes(path)
    report, remedied = lint(path, selection, text=data), 0
    for _ in range(_MOST_ROUNDS):
        batches = [finding.fix for finding in report.findings if finding.fix]
        chosen = _apart(batches)
        after = _attempt(path, selection, data, chosen, report.system)
        for batch in batches if after is None else ():  # together they do not go: the first that goes alone
            chosen = [batch]
            after = _attempt(path, selection, data, chosen, report.system)
            if after is not None:
                break
        if after is None:
            break
        (data, report), remedied = after, remedied + len(chosen)
    if data != original:
        if is_piped(path) or read_bytes(path) != original:
            raise UsageError(f"{os.fspath(path)} cannot be written back: it is a pipe, or was changed meanwhile")
        with replacing(path) as file:
            file.write(data)
    return report, remedied


def _apart(batches: Iterable[tuple[Edit, ...]]) -> list[tuple[Edit, ...]]:
    """The batches of edits that do not touch each other, the first of those that do."""
    taken: list[Edit] = []
    chosen: list[tuple[Edit, ...]] = []
    for batch in batches:
        if all(edit.end <= other.start or other.end <= edit.start for edit in batch for other in taken):
            taken.extend(batch)
            chosen.append(batch)
    return chosen


def _attempt(
    path: str | os.PathLike[str],
    selection: Sequence[str] | None,
    data: bytes,
    batches: list[tuple[Edit, ...]],
    before: HybridSystem,
) -> tuple[bytes, Report] | None:
    """The file with edits made and what is then found, if the model is still the same."""
    if not batches:
        return None
    content = decode(os.fspath(path), data).content
    for edit in sorted((edit for batch in batches for edit in batch), reverse=True):
        content = content[: edit.start] + edit.replacement + content[edit.end :]
    changed = _MARK * data.startswith(_MARK) + content.encode()
    try:
        report = lint(path, selection, text=changed)
    except ModelError:
        return None
    return (changed, report) if _meaning(report.system) == _meaning(before) else None


def _meaning(system: HybridSystem) -> tuple[Any, ...]:
    """What no fix may change."""
    edges = [[(e.name, e.target, e.surface.residual, e.condition, e.reset) for e in m.edges] for m in system.modes]
    modes = [(m.name, m.states, m.flow, m.final, m.outputs, m.scene) for m in system.modes]
    parameters = [(p.name, p.value, p.minimum, p.maximum) for p in system.parameters]
    return (modes, edges, parameters, system.inputs, system.outputs, system.initial, system.units, system.reference)
