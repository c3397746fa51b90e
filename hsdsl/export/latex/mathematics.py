# pyright: basic, reportIncompatibleMethodOverride=false
"""Expressions and texts of a model as LaTeX: SymPy's printer, with names and numbers as people write them.

Every sign of a text that has a meaning in LaTeX is escaped, and what fonts may lack is spelled out.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping
from functools import partialmethod
from typing import Any

from sympy.printing.latex import LatexPrinter

from hsdsl.base.functions import below
from hsdsl.base.names import visible
from hsdsl.base.numbers import decimals
from hsdsl.language.expression import plain
from hsdsl.language.expression.algebra import cases
from hsdsl.language.expression.scope import Function, symbol

_SIGNS = {">=": r"\geq", "<=": r"\leq", ">": ">", "<": "<"}
_PARTS = re.compile(r"(.*?[^0-9])([0-9]+)")
_MOST_PARTS = 9  # of the unit that are written as a fraction: others as decimals, where those end


class Mathematics:
    """Expressions with the names of one model: each has a form of its own."""

    def __init__(self, names: Iterable[str], functions: Mapping[str, Function] | None = None) -> None:
        self.functions = functions or {}
        self.names: dict[str, str] = {"t": "t"}
        for name in names:
            if name not in self.names:
                form = _form(name)
                taken = set(self.names.values())
                self.names[name] = rf"\text{{\texttt{{{escaped(name)}}}}}" if form in taken else form
        self.printer = _Printer({symbol(name): form for name, form in self.names.items()})

    def name(self, name: str) -> str:
        return self.names[name]

    def symbol(self, name: str) -> str:
        """A name as an expression writes it, also one of an automaton."""
        return self.printer.doprint(symbol(name))

    def expression(self, text: str) -> str:
        """An expression, as it was written."""
        return self.printer.doprint(plain.value(text, self.functions))

    def inequality(self, text: str) -> str:
        """One inequality, as it was written."""
        left, sign, right = plain.inequality(text, self.functions)
        return f"{self.printer.doprint(left)} {_SIGNS[sign]} {self.printer.doprint(right)}"

    def condition(self, text: str) -> str:
        """A condition, as it was written."""
        return self.printer.doprint(plain.condition(text, self.functions))

    def number(self, value: Any) -> str:
        """A number or an expression of SymPy."""
        return self.printer.doprint(value)


def _form(name: str) -> str:
    """A name as mathematics: Greek letters, one letter in italics, several upright, what follows `_` as an index."""
    head, *rest = [part for part in name.split("_") if part] or ["_"]
    match = _PARTS.fullmatch(head)
    if match:
        head, rest = match[1], [match[2], *rest]
    index = ",".join(_word(part) for part in rest)
    primes = "'" * (len(name) - len(name.rstrip("_")))
    return _word(head) + (f"_{{{index}}}" if index else "") + primes


def _word(word: str) -> str:
    if len(word) == 1 and greek_name(word) in GREEK:
        word = greek_name(word)
    if word in GREEK:
        return f"\\{word}"
    if word.isascii() and (len(word) == 1 or word.isdigit()):
        return word if word != "_" else r"\_"
    return rf"\mathrm{{{word}}}" if word.isascii() else rf"\text{{{escaped(word)}}}"


class _Printer(LatexPrinter):
    def __init__(self, names: dict[Any, str]) -> None:
        super().__init__({"symbol_names": names, "ln_notation": False, "mul_symbol": r"\,"})

    def _print_Symbol(self, expr: Any, style: str = "plain") -> str:
        if expr in self._settings["symbol_names"]:
            return super()._print_Symbol(expr, style)
        base, dot, attribute = expr.name.rpartition(".")  # of an instance, or a sum over several
        if "(" in expr.name:
            return rf"\text{{{escaped(expr.name)}}}"
        return _form(expr.name) if not dot else rf"\text{{{escaped(base)}}}.{_form(attribute)}"

    def _print_Rational(self, expr: Any) -> str:
        p, q = int(expr.p), int(expr.q)
        if q == 1:
            return str(p)
        if (abs(p) != 1 or q > _MOST_PARTS) and (decimal := _decimal(p, q)) is not None:
            return decimal
        sign, top = ("- " if p < 0 else ""), abs(p)
        return rf"{sign}\frac{{{top}}}{{{q}}}"

    def _print_absolute(self, expr: Any, exp: Any = None) -> str:
        text = rf"\left|{{{self._print(expr.args[0])}}}\right|"
        return f"{text}^{{{exp}}}" if exp is not None else text

    def _print_floor(self, expr: Any, exp: Any = None) -> str:
        text = rf"\left\lfloor{{{self._print(expr.args[0])}}}\right\rfloor"
        return f"{text}^{{{exp}}}" if exp is not None else text

    def _named(self, name: str, expr: Any, exp: Any = None) -> str:
        arguments = ", ".join(self._print(argument) for argument in expr.args)
        power = f"^{{{exp}}}" if exp is not None else ""
        return rf"{name}{power}\left({arguments}\right)"

    _print_minimum = partialmethod(_named, r"\min")
    _print_maximum = partialmethod(_named, r"\max")
    _print_sign = partialmethod(_named, r"\operatorname{sign}")
    _print_atan2 = partialmethod(_named, r"\operatorname{atan2}")

    def _print_below(self, expr: Any, exp: Any = None) -> str:
        text = self._print_Piecewise(cases(expr))
        return rf"\left({text}\right)^{{{exp}}}" if exp is not None else text

    def _needs_mul_brackets(self, expr: Any, first: bool = False, last: bool = False) -> bool:
        return isinstance(expr, below) or super()._needs_mul_brackets(expr, first, last)

    def _needs_add_brackets(self, expr: Any) -> bool:
        return isinstance(expr, below) or super()._needs_add_brackets(expr)


def _decimal(p: int, q: int) -> str | None:
    """P/q as a decimal, where that ends and is short."""
    found = decimals.short(p, q)
    if found is None:
        return None
    mantissa, exponent = found
    return rf"{mantissa} \cdot 10^{{{exponent}}}" if exponent else mantissa


_ESCAPES = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\(<\)",
    ">": r"\(>\)",
    "|": r"\(|\)",
    '"': "''",
    "°": r"\(^\circ\)",
    "·": r"\(\cdot\)",
    "×": r"\(\times\)",
    "²": r"\(^2\)",
    "³": r"\(^3\)",
    "–": "--",
    "—": "---",
    "ß": r"\ss{}",
    "ø": r"\o{}",
    "Ø": r"\O{}",
    "æ": r"\ae{}",
    "Æ": r"\AE{}",
    "ł": r"\l{}",
    "Ł": r"\L{}",
    "’": "'",
    "‘": "`",
    "“": "``",
    "”": "''",
    **{sign: f"\\{sign}" for sign in "#$%&_{}"},
}
_ACCENTS = {"\u0300": "`", "\u0301": "'", "\u0302": "^", "\u0303": "~", "\u0308": '"', "\u030a": "r", "\u030c": "v"}
_ACCENTS["\u0327"] = "c"
_LETTERS = "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi"
_CAPITALS = "Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega"
GREEK = frozenset(f"{_LETTERS} psi omega {_CAPITALS}".split())  # that LaTeX has commands for


def escaped(text: str) -> str:
    """A text in one line that LaTeX prints as it is."""
    return "".join(map(_sign, unicodedata.normalize("NFC", visible(text))))


def _sign(sign: str) -> str:
    if sign in _ESCAPES:
        return _ESCAPES[sign]
    if sign.isascii():
        return sign
    greek = greek_name(sign)
    if greek in GREEK:
        return rf"\(\{greek}\)"
    base, *marks = unicodedata.normalize("NFD", sign)
    if base.isascii() and base.isalpha() and len(marks) == 1 and marks[0] in _ACCENTS:
        letter = {"i": r"\i", "j": r"\j"}.get(base, base)
        return rf"\{_ACCENTS[marks[0]]}{{{letter}}}"
    return f"[U+{ord(sign):04X}]"


def greek_name(sign: str) -> str:
    """The name of a Greek letter, capital ones with a capital; empty for another sign."""
    name = unicodedata.name(sign, "")
    kind, _, letter = name.partition(" LETTER ")
    known = {"LAMDA": "lambda"}.get(letter, letter.lower())
    return {"GREEK SMALL": known, "GREEK CAPITAL": known.capitalize()}.get(kind, "")


WIDEST = 90  # signs of a formula that fit into a line, roughly: a longer one is a paragraph that breaks by itself
_COMMAND = re.compile(r"\\[A-Za-z]+|[{}^_ ]")


def equations(pairs: list[tuple[str, str]]) -> list[str]:
    """Equations below each other, aligned; where one is too long for that, each is a paragraph."""
    if not pairs:
        return []
    if any(len(_COMMAND.sub("", left + right)) > WIDEST for left, right in pairs):
        return [r"\begin{flushleft}", *(rf"\({left} = {right}\)\par" for left, right in pairs), r"\end{flushleft}"]
    rows = [rf"{left} &= {right}" for left, right in pairs]
    return [r"\begin{align*}", " \\\\\n".join(rows), r"\end{align*}"]


def stacked(formulas: list[str]) -> list[str]:
    return [r"\begin{gather*}", " \\\\\n".join(formulas), r"\end{gather*}"]
