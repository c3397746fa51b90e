"""Samples of an input from a CSV file: exact numbers, and the row and column of what is wrong."""

from __future__ import annotations

import re
from fractions import Fraction

from hsdsl.elaborate.symbols import SymbolTable
from hsdsl.errors import Diagnostic, Span
from hsdsl.files import DataRefused
from hsdsl.names import did_you_mean, shown
from hsdsl.source import ABSENT, Key, Scalar

_MOST_FAULTS = 10  # of one file: a wrong column would bury everything else
_NUMBER = re.compile(r"[+-]?(?:[0-9]{1,400}\.?[0-9]{0,400}|\.[0-9]{1,400})(?:[eE][+-]?[0-9]{1,3})?")

Samples = tuple[tuple[Fraction, ...], tuple[Fraction, ...]]


def read_samples(symbols: SymbolTable, name: Key, file: Scalar) -> Samples | None:
    """Times and values of the column ``name``; None where the file has faults, which are reported."""
    if file.value == ABSENT:
        return None
    try:
        data = symbols.content(file.value)
    except DataRefused as refusal:
        symbols.resolver.add(file.place, refusal.code, refusal.message, refusal.hint)
        return None
    try:
        lines = data.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        symbols.resolver.add(file.place, "HS312", f"the file '{shown(file.value)}' is not UTF-8 text")
        return None
    table = _Table(str(symbols.files.folder / file.value), lines)
    samples = table.samples(name)
    for diagnostic in table.faults:
        symbols.resolver.findings.add(diagnostic)
    return None if table.faults else samples


def _hint(name: str, columns: list[str]) -> str | None:
    """What a header probably meant."""
    if any(mark in column for column in columns for mark in ";\t"):
        return "columns are separated by commas, and numbers have decimal points"
    if name in columns:
        return "the column of times is called `time`"
    return did_you_mean(name, columns)


class _Table:
    """A comma-separated table, and what is wrong with it."""

    def __init__(self, path: str, lines: list[str]) -> None:
        self.path = path
        self.lines = lines
        self.faults: list[Diagnostic] = []

    def samples(self, name: str) -> Samples | None:
        """The columns ``time`` and ``name``."""
        columns = [cell.strip().strip('"') for cell in self.lines[0].split(",")] if self.lines else []
        if "time" not in columns or name not in columns:
            there = ", ".join(f"'{shown(c)}'" for c in columns if c) or "nothing"
            message = f"the header must be `time,{name}`, and has {there}"
            self.fault(1, 1, len(self.lines[0]) if self.lines else 1, message, _hint(name, columns))
            return None
        wanted = (columns.index("time"), columns.index(name))
        times: list[Fraction] = []
        values: list[Fraction] = []
        for number, line in enumerate(self.lines[1:], start=2):
            if line.strip() and len(self.faults) < _MOST_FAULTS:
                self.row(number, line, len(columns), wanted, times, values)
        if not times and not self.faults:
            self.fault(1, 1, len(self.lines[0]), "the file has no rows below its header")
        return tuple(times), tuple(values)

    def row(
        self,
        number: int,
        line: str,
        width: int,
        wanted: tuple[int, int],
        times: list[Fraction],
        values: list[Fraction],
    ) -> None:
        """One sample."""
        cells = line.split(",")
        if len(cells) != width:
            self.fault(number, 1, len(line), f"this row has {len(cells)} columns and the header {width}")
            return
        time, value = (self.cell(number, cells, column) for column in wanted)
        if time is None or value is None:
            return
        if times and time <= times[-1]:
            start = len(",".join(cells[: wanted[0]])) + (1 if wanted[0] else 0)
            self.fault(number, start + 1, len(cells[wanted[0]]), "the times do not increase here")
            return
        times.append(time)
        values.append(value)

    def cell(self, number: int, cells: list[str], column: int) -> Fraction | None:
        """One number, exactly."""
        text = cells[column].strip().strip('"').strip()
        if _NUMBER.fullmatch(text):
            value = Fraction(text)
            if abs(value) < 2**1024:
                return value
        start = sum(len(cell) + 1 for cell in cells[:column])
        message = f"'{shown(text, 40)}' in column {column + 1} is not a finite number"
        self.fault(number, start + 1, max(1, len(cells[column])), message)
        return None

    def fault(self, line: int, column: int, length: int, message: str, hint: str | None = None) -> None:
        """Report something at a place of the table."""
        text = self.lines[line - 1] if line <= len(self.lines) else ""
        self.faults.append(Diagnostic("HS312", message, Span(self.path, line, column, max(1, length)), hint, text))
