# pyright: basic, reportIncompatibleMethodOverride=false
"""A model as notebooks display it: parameters, the graph of its modes, and their equations as MathML.

Browsers draw MathML by themselves; the LaTeX of expressions is in `hsdsl.export.latex`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from typing import Any

from sympy.printing.conventions import split_super_sub
from sympy.printing.mathml import MathMLPresentationPrinter

from hsdsl.analysis.report import mode_graph
from hsdsl.analysis.report.mode_graph import visited_part
from hsdsl.analysis.report.words import escaped, html_row, html_table
from hsdsl.base.names import called, counted, shown, visible, without_memory
from hsdsl.base.numbers import decimals
from hsdsl.base.parts import written_edges, written_modes
from hsdsl.language.elaborate.definitions import named_functions
from hsdsl.language.expression import plain
from hsdsl.language.expression.algebra import cases
from hsdsl.language.expression.parse import ExpressionError
from hsdsl.language.expression.scope import Function, state, symbol
from hsdsl.language.system import Edge, HybridSystem, Mode
from hsdsl.mathematics.program import Program

MOST_MODES, MOST_OPEN = 40, 4  # modes that are shown; that are unfolded
MOST_ROWS, MOST_EQUATIONS = 30, 60  # of a table; of a mode
CSS = ".hsdsl summary { cursor: pointer } .hsdsl ul { margin: .2rem 0 } .hsdsl .modes { max-width: 60rem }"


def model_html(system: HybridSystem, program: Program) -> str:
    """Return the model in a ``div``; every text of the model is escaped, and nothing is fetched."""
    parameters = {parameter.name: state(parameter.name) for parameter in system.parameters}
    math = Mathematics(system.names, named_functions(system.functions, parameters))
    written = written_modes(system.modes)
    kind, number = ("part", len(system.parts)) if system.parts else ("mode", len(written))
    count = f"{number} {kind}{'s' * (number != 1)}"
    heading = f"<p><strong>{escaped(called(system.title, system.path))}</strong><br>{count}, {_start(system, math)}</p>"
    modes = [_mode(system, mode, math, len(written) <= MOST_OPEN) for mode in written[:MOST_MODES]]
    left = len(written) - MOST_MODES
    more = [f"<p>{left} more modes</p>"] if left > 0 else []
    rows = [(part.name, ", ".join(part.modes), part.modes[part.start]) for part in system.parts]
    inputs = [f"{escaped(given.name)} is an input of {counted(len(given.times), 'sample')}" for given in system.inputs]
    given = [(p.name, p.text, p.unit or "", p.about or "") for p in system.parameters]
    parts = [
        heading,
        _table(("parameter", "value", "unit", "meaning"), given),
        _table(("part", "modes", "starts in"), rows),
        _list([*inputs, *_definitions(system, None, math)]),
        mode_graph.graph_of(visited_part(program, None)),
        *modes,
        *more,
    ]
    return f'<div class="hsdsl"><style>{mode_graph.CSS}{CSS}</style>{"".join(parts)}</div>'


def _start(system: HybridSystem, math: Mathematics) -> str:
    initial, until = system.initial, math.value(system.experiment.until)
    numbers = {part.name for part in system.parts if part.is_numbered}
    seen = {*without_memory(dict(initial.values))} - numbers
    start = [(name, value) for name, value in initial.values if name in seen]
    values = ", ".join(f"{escaped(name)} = {math.value(value)}" for name, value in start[:MOST_ROWS])
    values += ", ..." if len(start) > MOST_ROWS else ""
    where = "" if system.parts else f" in {escaped(initial.mode)}"
    return f"starts{where}{' at ' if values else ''}{values}, until {until}"


def _table(names: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    if not rows:
        return ""
    more = [(f"{len(rows) - MOST_ROWS} more", *[""] * (len(names) - 1))] * (len(rows) > MOST_ROWS)
    rows = [*rows[:MOST_ROWS], *more]
    used = [k for k in range(len(names)) if any(row[k] for row in rows)]
    return html_table([names[k] for k in used], (html_row(row[k] for k in used) for row in rows))


def _definitions(system: HybridSystem, mode: str | None, math: Mathematics) -> list[str]:
    return [math.equation(math.name(d.name), d.text) for d in system.definitions if d.mode == mode][:MOST_ROWS]


def _list(items: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{item}</li>" for item in items) + "</ul>" if items else ""


def _mode(system: HybridSystem, mode: Mode, math: Mathematics, unfolded: bool) -> str:
    seen = {*without_memory(mode.states)} - {part.name for part in system.parts if part.is_numbered}
    flows = zip(mode.states, mode.flow_texts, strict=True)
    flow = [math.derivative(name, text) for name, text in flows if name in seen]
    walls = [f"domain: {math.inequality(wall.text)}" for wall in mode.walls]
    written = written_edges(mode.edges)
    edges = [_edge(edge, math, not system.parts) for edge in written[:MOST_EQUATIONS]]
    edges += [f"{len(written) - MOST_EQUATIONS} more transitions"] * (len(written) > MOST_EQUATIONS)
    items = [*flow[:MOST_EQUATIONS], *([f"{len(flow) - MOST_EQUATIONS} more"] * (len(flow) > MOST_EQUATIONS))]
    items += [*_definitions(system, mode.name, math), *walls, *edges]
    name = f"{escaped(shown(mode.name))}{' (final)' if mode.final else ''}"
    opened = " open" if unfolded else ""
    summary = "equations of all parts" if system.parts else f"mode <strong>{name}</strong>"
    return f"<details{opened}><summary>{summary}</summary>{_list(items)}</details>"


def _edge(edge: Edge, math: Mathematics, named: bool) -> str:
    """A transition; ``named`` says that its target has a name that people gave."""
    condition = f" if {math.condition(edge.condition_text)}" if edge.condition_text else ""
    when = f"when {math.inequality(edge.surface.text)}{condition}"
    if edge.of_event:
        _, event, *options = edge.of_event
        when = ", ".join([f"event {math.condition(event)}", *map(escaped, options)])
    resets = zip(edge.target_states, edge.reset_texts, strict=True)
    seen = without_memory(edge.target_states)
    changed = ", ".join(math.reset(name, text) for name, text in resets if text != name and name in seen)
    ends = f"<strong>{escaped(edge.name)}</strong>{f' to {escaped(edge.target)}' if named else ''}"
    return f"{ends} {when}{': ' if changed else ''}{changed}"


_SIGNS = {">=": "≥", "<=": "≤", ">": ">", "<": "<"}
_FENCES = {"absolute": ("|", "|"), "floor": ("⌊", "⌋")}
_NAMED = {"minimum": "min", "maximum": "max", "sign": "sign", "atan2": "atan2"}
_REPLACED = {"&InvisibleTimes;": '<mspace width="0.17em"></mspace>', "-": "<mo>−</mo>"}
_REPLACED |= {"<": "<mo>&lt;</mo>", ">": "<mo>&gt;</mo>"}  # SymPy leaves them as they are
_MOST_PARTS = 9  # of the unit that are written as a fraction: others as decimals, where those end


class Mathematics:
    """Expressions with the names of one model: two names that would look alike are printed as they are written.

    So is an expression that is no mathematics of one mode: that of a part, whose names are those of its automaton.
    """

    def __init__(self, names: Iterable[str], functions: Mapping[str, Function] | None = None) -> None:
        self.functions = functions or {}
        forms: dict[tuple[Any, ...], set[str]] = {}
        for name in names:
            head, above, below = split_super_sub(name)
            forms.setdefault((head, *above, "_", *below), set()).add(name)
        alike = {name for same in forms.values() if len(same) > 1 for name in same}
        self.printer = _Printer(alike)

    def name(self, name: str) -> str:
        return self.printer.doprint(symbol(name))

    def equation(self, left: str, text: str) -> str:
        """An equation whose left side is MathML."""
        return self._formula(f"{left}<mo>=</mo>", text, lambda: plain.value(text, self.functions))

    def derivative(self, name: str, text: str) -> str:
        """The flow of a state."""
        return self.equation(f"<mover><mrow>{self.name(name)}</mrow><mo>˙</mo></mover>", text)

    def reset(self, name: str, text: str) -> str:
        """What a state is after a transition."""
        return self.equation(f"<msup><mrow>{self.name(name)}</mrow><mo>+</mo></msup>", text)

    def inequality(self, text: str) -> str:
        """One inequality, as it was written."""
        try:
            left, sign, right = plain.inequality(text, self.functions)
        except ExpressionError:
            return _code(text)
        middle = f"<mo>{escape(_SIGNS[sign])}</mo>"
        return _formula(f"{self.printer.doprint(left)}{middle}{self.printer.doprint(right)}")

    def condition(self, text: str) -> str:
        return self._formula("", text, lambda: plain.condition(text, self.functions))

    def _formula(self, left: str, text: str, read: Callable[[], Any]) -> str:
        try:
            return _formula(left + self.printer.doprint(read()))
        except ExpressionError:
            return (_formula(left) if left else "") + _code(text)

    def value(self, value: Any) -> str:
        """An expression of SymPy."""
        return _formula(self.printer.doprint(value))


def _code(text: str) -> str:
    return f"<code>{escape(visible(text))}</code>"


def _formula(inside: str) -> str:
    return f'<math xmlns="http://www.w3.org/1998/Math/MathML" displaystyle="true"><mrow>{inside}</mrow></math>'


class _Printer(MathMLPresentationPrinter):
    def __init__(self, alike: set[str]) -> None:
        super().__init__({"mul_symbol": None})
        self.alike = alike

    def doprint(self, expr: Any) -> str:
        """Print an expression; a product has a thin space, so that `a*cos(b)` does not read `acos(b)`."""
        text = super().doprint(expr)
        for sign, other in _REPLACED.items():
            text = text.replace(f"<mo>{sign}</mo>", other)
        return text

    def _print_Symbol(self, sym: Any, style: str = "plain") -> Any:
        return self._leaf("mi", sym.name) if sym.name in self.alike else super()._print_Symbol(sym, style)

    def _print_Rational(self, e: Any) -> Any:
        p, q = int(e.p), int(e.q)
        found = decimals.short(p, q) if abs(p) != 1 or q > _MOST_PARTS else None
        return super()._print_Rational(e) if found is None or q == 1 else self._decimal(*found)

    def _decimal(self, mantissa: str, exponent: int) -> Any:
        parts = [self._leaf("mo", "-")] if mantissa.startswith("-") else []
        parts.append(self._leaf("mn", mantissa.lstrip("-")))
        if exponent:
            power = self._row("msup", self._leaf("mn", "10"), self._leaf("mn", str(exponent).replace("-", "−")))
            parts += [self._leaf("mo", "·"), power]
        return self._row("mrow", *parts)

    def _print_Function(self, e: Any) -> Any:
        kind = type(e).__name__
        if kind in _FENCES:
            left, right = _FENCES[kind]
            return self._row("mrow", self._leaf("mo", left), self._print(e.args[0]), self._leaf("mo", right))
        if kind not in _NAMED:
            return super()._print_Function(e)
        inner: list[Any] = [self._leaf("mo", "(")]
        for i, argument in enumerate(e.args):
            inner += [*([self._leaf("mo", ",")] if i else []), self._print(argument)]
        return self._row("mrow", self._leaf("mi", _NAMED[kind]), self._row("mrow", *inner, self._leaf("mo", ")")))

    _print_floor = _print_absolute = _print_minimum = _print_maximum = _print_sign = _print_atan2 = _print_Function

    def _print_below(self, e: Any) -> Any:
        (one, positive), (other, _) = cases(e).args
        where = self._row("mrow", self._leaf("mtext", "where\u00a0"), self._print(positive))
        rows = [
            self._row("mtr", *(self._row("mtd", part) for part in (self._print(value), condition)))
            for value, condition in ((one, where), (other, self._leaf("mtext", "elsewhere")))
        ]
        return self._row("mrow", self._leaf("mo", "("), self._row("mtable", *rows), self._leaf("mo", ")"))

    def _leaf(self, tag: str, text: str) -> Any:
        element = self.dom.createElement(tag)
        element.appendChild(self.dom.createTextNode(text))
        return element

    def _row(self, tag: str, *parts: Any) -> Any:
        element = self.dom.createElement(tag)
        for part in parts:
            element.appendChild(part)
        return element
