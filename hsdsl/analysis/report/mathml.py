# pyright: basic, reportIncompatibleMethodOverride=false
"""Expressions of a model as MathML, which browsers draw by themselves; the LaTeX of them is in `hsdsl.export.latex`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from html import escape
from typing import Any

from sympy.printing.conventions import split_super_sub
from sympy.printing.mathml import MathMLPresentationPrinter

from hsdsl.base.names import visible
from hsdsl.base.numbers import decimals
from hsdsl.language.expression import plain
from hsdsl.language.expression.algebra import cases
from hsdsl.language.expression.parse import ExpressionError
from hsdsl.language.expression.scope import Function, symbol

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
        """A name."""
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
        """A condition."""
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
