# pyright: basic
"""Inputs: expressions of time, which are substituted, and samples, which stay symbols.

Samples of a CSV file are exact numbers; its faults have their row and column.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from fractions import Fraction
from math import nan
from typing import Any

from hsdsl.base.errors import Diagnostic, Span
from hsdsl.base.names import closest, counted, did_you_mean, is_identifier, shown
from hsdsl.base.samples import Hold, in_order
from hsdsl.language.elaborate.symbols import Meanings, SymbolTable
from hsdsl.language.expression.scope import Refusal, Scope, Value, symbol
from hsdsl.language.files import DataRefused
from hsdsl.language.schema.documents import InputFile, InputSamples
from hsdsl.language.source import ABSENT, Key, Scalar
from hsdsl.language.system import SampledInput

_STEP = "for a step leave out the first of the two; with `hold: linear` both count, as a jump between two ramps"
_THIRD = "at a jump give two: the value before it and the one behind it"
_EARLIER = "give each time once, the earliest first"
_MOST_FAULTS = 10  # of one file: a wrong column would bury everything else
_NUMBER = re.compile(r"[+-]?(?:[0-9]{1,400}\.?[0-9]{0,400}|\.[0-9]{1,400})(?:[eE][+-]?[0-9]{1,3})?")

Samples = tuple[tuple[Fraction, ...], tuple[Fraction, ...]]


def define_inputs(symbols: SymbolTable) -> tuple[SampledInput, ...]:
    """The sampled inputs; the meaning of every input goes to ``symbols.values``."""
    feedback = "write expressions of states under `let`, or in `flow` itself"
    names, hint = symbols.document.inputs, "combine them under `let`"
    refusals: Meanings = {
        str(name): Refusal("HS117", f"'{name}' is an input; an input cannot use another input", hint) for name in names
    }
    sentence = "an input is an expression of t and parameters"
    timed = symbols.scope(("time", "parameters"), sentence, refusals, hint=feedback)
    constant = symbols.scope(("parameters",), "samples are numbers or expressions of parameters")
    inputs: list[SampledInput] = []
    for name, entry in symbols.document.inputs.items():
        if isinstance(entry, Scalar):
            value = symbols.values[name] = symbols.number(entry, timed)
            if symbols.drivable and value is not None:
                unit = symbols.text(symbols.document.units.get(name))
                inputs.append(SampledInput(str(name), "zero", (Fraction(0),), (Fraction(0),), unit, value.expr))
                symbols.values[name] = Value(value.expr * symbol(switch_name(name)) + symbol(name))
            continue
        symbols.values[name] = Value(symbol(name))
        in_file = isinstance(entry, InputFile)
        samples = read_samples(symbols, name, entry) if in_file else _inline(symbols, name, entry, constant)
        if samples is not None:
            unit = symbols.text(symbols.document.units.get(name))
            inputs.append(SampledInput(str(name), entry.hold, samples[0], samples[1], unit))
    return tuple(inputs)


def switch_name(name: str) -> str:
    """The parameter that turns the expression of a drivable input off; no file can have a name with a blank."""
    return f"{name} given"


def _inline(symbols: SymbolTable, name: Key, entry: InputSamples, scope: Scope) -> Any:
    times = symbols.numbers(entry.times, scope, finite_now=True)
    values = symbols.numbers(entry.values, scope, finite_now=True)
    if len(entry.times) != len(entry.values):
        message = (
            f"the input '{name}' has {counted(len(entry.times), 'time')} and {counted(len(entry.values), 'value')}"
        )
        symbols.report(name.place, "HS310", message, "give one value for each time")
        return None
    if not entry.times:
        symbols.report(name.place, "HS310", f"the input '{name}' has no samples", "give at least one")
        return None
    if times is None or values is None:
        return None
    known = [time.number if time.constant else nan for time in times]
    for k, scalar in enumerate(entry.times):
        if k > 0 and times[k].constant and times[k - 1].constant and not in_order(entry.hold, known, k):
            message = f"the times of the input '{name}' do not increase here"
            symbols.report(scalar.place, "HS310", message, _order_hint(entry.hold, known, k))
    return tuple(map(_exact, times)), tuple(map(_exact, values))


def _order_hint(hold: Hold, times: Sequence[Any], k: int) -> str:
    """What to write where sample k does not follow those before it."""
    same = _STEP if hold == "zero" else _THIRD
    return same if times[k] == times[k - 1] else _EARLIER


def _exact(value: Value) -> Any:
    """An exact number where there is one."""
    return Fraction(int(value.expr.p), int(value.expr.q)) if value.expr.is_Rational else value.expr


def read_samples(symbols: SymbolTable, name: Key, entry: InputFile) -> Samples | None:
    """Times and values of the input's column; None where the file has faults, which are reported."""
    file, column = entry.file, entry.column
    if file.value == ABSENT or (column is not None and column.value == ABSENT):
        return None
    try:
        lines = symbols.content(file.value).decode("utf-8-sig").splitlines()
    except DataRefused as refusal:
        symbols.report(file.place, refusal.code, refusal.message, refusal.hint)
        return None
    except UnicodeDecodeError:
        symbols.report(file.place, "HS312", f"the file '{shown(file.value)}' is not UTF-8 text")
        return None
    table = _Table(str(symbols.files.folder / file.value), lines, entry.hold)
    table.read(name if column is None else column.value.strip(), file.value if column is None else None)
    for diagnostic in table.faults:
        symbols.findings.add(diagnostic)
    return None if table.faults else (tuple(table.times), tuple(table.values))


def _hint(name: str, columns: list[str], file: str | None) -> str | None:
    """The hint for a wrong header; ``file`` where the model may say which column it is."""
    if any(mark in column for column in columns for mark in ";\t"):
        return "columns are separated by commas, and numbers have decimal points"
    if name in columns:
        return "the column of times is called `time`"
    others = [column for column in columns if column and column != "time"]
    if file is None or not others or "time" not in columns:
        return did_you_mean(name, others)
    column = shown(closest(name, others) or "...")
    column = column if is_identifier(column) or column == "..." else f'"{column}"'
    return f"name its column: {{file: {shown(file)}, column: {column}}}"


def _header(line: str) -> list[str]:
    """The names of the columns; a name in quotes may have commas."""
    try:
        return [cell.strip() for cell in next(csv.reader([line], skipinitialspace=True), [])]
    except csv.Error:  # a name of more than a hundred thousand letters
        return [cell.strip() for cell in line.split(",")]


class _Table:
    """The samples of a comma-separated table, and its faults."""

    def __init__(self, path: str, lines: list[str], hold: Hold) -> None:
        self.path, self.lines = path, lines
        self.hold: Hold = hold
        self.times: list[Fraction] = []
        self.values: list[Fraction] = []
        self.faults: list[Diagnostic] = []

    def read(self, name: str, file: str | None) -> None:
        """Read the columns ``time`` and ``name``; ``file`` where the model may say which column it is."""
        header = self.lines[0] if self.lines else ""
        columns = _header(header)
        if "time" not in columns or name not in columns:
            present = ", ".join(f"'{shown(c)}'" for c in columns if c) or "nothing"
            message = f"expected the columns `time` and `{name}`, got {present}"
            self.fault(1, 1, len(header) if self.lines else 1, message, _hint(name, columns, file))
            return
        twice = next((column for column in ("time", name) if columns.count(column) > 1), None)
        if twice is not None:
            self.fault(1, 1, len(header), f"expected a column once, got '{shown(twice)}' twice")
            return
        for number, line in enumerate(self.lines[1:], start=2):
            if line.strip() and len(self.faults) < _MOST_FAULTS:
                self.row(number, line, len(columns), columns.index("time"), columns.index(name))
        if not self.times and not self.faults:
            self.fault(1, 1, len(header), "the file has no rows below its header")

    def row(self, number: int, line: str, width: int, at: int, own: int) -> None:
        """Read one sample: its time and its value are in these columns."""
        cells = line.split(",")
        if len(cells) != width:
            self.fault(number, 1, len(line), f"this row has {counted(len(cells), 'column')} and the header {width}")
            return
        time, value = self.cell(number, cells, at), self.cell(number, cells, own)
        if time is None or value is None:
            return
        times = [*self.times[-2:], time]
        if self.times and not in_order(self.hold, times, len(times) - 1):
            hint = _order_hint(self.hold, times, len(times) - 1)
            self.fault(number, _start(cells, at), len(cells[at]), "the times do not increase here", hint)
            return
        self.times.append(time)
        self.values.append(value)

    def cell(self, number: int, cells: list[str], column: int) -> Fraction | None:
        """Read one number, exactly."""
        text = cells[column].strip().strip('"').strip()
        if _NUMBER.fullmatch(text):
            value = Fraction(text)
            if abs(value) < 2**1024:
                return value
        message = f"'{shown(text, 40)}' in column {column + 1} is not a finite number"
        self.fault(number, _start(cells, column), len(cells[column]), message)
        return None

    def fault(self, line: int, column: int, length: int, message: str, hint: str | None = None) -> None:
        """Report something at a place of the table."""
        text = self.lines[line - 1] if line <= len(self.lines) else ""
        self.faults.append(Diagnostic("HS312", message, Span(self.path, line, column, max(1, length)), hint, text))


def _start(cells: list[str], column: int) -> int:
    """The place of a cell in its line, from 1."""
    return 1 + sum(len(cell) + 1 for cell in cells[:column])
