"""Expressions cut into tokens. What belongs to other languages is answered here with the right form."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from hsdsl.base.names import LOOKALIKES, normalised, plain_sign, shown, told_apart
from hsdsl.language.expression.expression_hints import SIGNS, better
from hsdsl.language.expression.syntax import Expected, ExpressionError

LONGEST = 10_000  # characters
LARGEST_INTEGER = 10**18
_MOST_DIGITS = 1000
_NUMBER = re.compile(r"0[xX][0-9a-fA-F]+|0[oO][0-7]+|([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_OPERATOR = re.compile(r"\*\*|<=|>=|==|!=|[-+*/(),<>]")
_MEMBER = re.compile(r"(\[[^\[\]\n]{1,100}\])?\.([^\W\d]\w*)")  # of an instance of a part
_GROUPED = re.compile(r"[0-9]+(_[0-9]+)+")


@dataclass(frozen=True, slots=True)
class Token:
    """A number, a name, an operator, or the end."""

    kind: Literal["number", "name", "operator", "end"]
    text: str
    start: int
    end: int
    value: Fraction = Fraction(0)


def tokenize(text: str, expected: Expected) -> list[Token]:
    """The tokens of an expression, the last one being the end.

    Raises ExpressionError: at the first character that begins none.
    """
    if len(text) > LONGEST:
        message = f"the expression has {len(text):,} characters; the most is {LONGEST:,}"
        raise ExpressionError("HS110", message, 0, 1, "name its parts under `let`")
    tokens: list[Token] = []
    at = 0
    while at < len(text):
        if text[at].isspace():
            at += 1
            continue
        token = _number(text, at) or _name(text, at) or _operator(text, at, expected)
        tokens.append(token)
        at = token.end
    tokens.append(Token("end", "", len(text), len(text)))
    return tokens


def _number(text: str, at: int) -> Token | None:
    grouped = _GROUPED.match(text, at)
    if grouped:
        plain = grouped.group().replace("_", "")
        raise ExpressionError("HS105", "digits are not grouped by `_`", at, grouped.end(), f"write {shown(plain)}")
    match = _NUMBER.match(text, at)
    if not match:
        return None
    return Token("number", match.group(), at, match.end(), _value(match, at))


def _value(match: re.Match[str], at: int) -> Fraction:
    digits, exponent = match.group(1), match.group(2)
    if len(match.group()) > _MOST_DIGITS:
        raise ExpressionError("HS124", f"the number has more than {_MOST_DIGITS:,} digits", at, match.end())
    if digits is None or (digits.isdigit() and not exponent):
        value = int(match.group(), 10 if digits else 0)
        if value > LARGEST_INTEGER:
            hint = "write it with an exponent: 2.5e20"
            raise ExpressionError("HS124", "a whole number is at most 1e18", at, match.end(), hint)
        return Fraction(value)
    power = int(exponent[1:]) if exponent else 0
    return _scaled(Fraction(digits), power, at, match.end())


def _scaled(mantissa: Fraction, power: int, start: int, end: int) -> Fraction:
    """``mantissa * 10**power``, refused where a float could not hold it, before anything large is computed."""
    if mantissa == 0:
        return mantissa
    if abs(power) <= 2 * _MOST_DIGITS:
        value = mantissa * Fraction(10) ** power
        if Fraction(1, 2**1074) <= value < 2**1024:
            return value
    if power > 0:
        raise ExpressionError("HS118", "the number is too large to have a finite value", start, end)
    raise ExpressionError("HS105", "the number is below the smallest float", start, end, "write 0")


def _name(text: str, at: int) -> Token | None:
    if not text[at].isidentifier():
        return None
    end = at + 1
    while end < len(text) and ("a" + text[end]).isidentifier() and text[end] not in LOOKALIKES:
        end += 1
    member = _MEMBER.match(text, end)
    end = member.end() if member and member.group(2).isidentifier() else end
    return Token("name", normalised(text[at:end]), at, end)


def _operator(text: str, at: int, expected: Expected) -> Token:
    match = _OPERATOR.match(text, at)
    if match:
        return Token("operator", match.group(), at, match.end())
    if text[at] == "=":
        raise _equals(text, at, expected)
    for sign, code, message, hint in SIGNS:
        if text.startswith(sign, at):
            raise ExpressionError(code, message, at, at + len(sign), better(sign, text, at) or hint)
    if plain := plain_sign(text[at]):
        raise ExpressionError("HS101", told_apart(text[at]), at, at + 1, f"write `{plain}`")
    raise ExpressionError("HS101", f"the character `{text[at]}` has no meaning in an expression", at, at + 1)


def _equals(text: str, at: int, expected: Expected) -> ExpressionError:
    for wrong, right in (("=>", ">="), ("=<", "<=")):
        if text.startswith(wrong, at):
            return ExpressionError("HS107", f"`{wrong}` is not an inequality", at, at + 2, f"write `{right}`")
    hints = {"number": "write the right-hand side alone", "condition": "write `==`", "inequality": "write `>=` or `<=`"}
    return ExpressionError("HS107", "`=` has no meaning in an expression", at, at + 1, hints[expected])
