"""Signs, words and names of other languages in expressions: what is wrong, and their right form here.

A fault is a code, a sentence, the range of its characters, and a hint.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Container, Sequence
from typing import Any

from hsdsl.base.functions import CONSTANTS, FUNCTIONS  # pyright: ignore[reportUnknownVariableType]
from hsdsl.base.names import closest, did_you_mean, plain_sign, shown, told_apart
from hsdsl.language.diagnosis import TABLES

Fault = tuple[str, str, int, int, str | None]

NAMES: dict[str, str] = {name: hint for hint, names in TABLES["names"].items() for name in names.split()}
CASES = NAMES["if"]
_MISCOUNTED = {  # functions by a number of arguments that other languages give them
    ("log", 2): "write log(x)/log(b) for the logarithm to the base b",
    ("atan", 2): "write atan2(y, x)",
}
# signs: their characters, a code, a sentence, the right form; longer signs come before their beginnings
_SIGNS = (
    *(
        (sign, code, f"`{sign}` is not an operator of the language", f"write {right}")
        for code, signs in TABLES["operators"].items()
        for sign, right in signs.items()
    ),
    *((sign, *rest) for signs, rest in TABLES["signs"].items() for sign in signs),
)
_EQUALS = {"number": "write the right-hand side alone", "condition": "write `==`", "inequality": "write `>=` or `<=`"}
_FOREIGN_WORDS = ("if", "else", "for", "in", "is", "lambda", "then", "AND", "OR", "NOT")
_UNITS = frozenset(TABLES["units"]["names"].split())
_QUANTITY = re.compile(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*((?:[^\W\d]+\s*[*/·]\s*)*)([^\W\d]+)\s*")
_PLAIN_NUMBER = re.compile("[0-9.]{1,20}(?:[eE][-+]?[0-9]{1,2})?")
_POWERS = {"G": 9, "M": 6, "k": 3, "c": -2, "m": -3, "u": -6, "µ": -6, "n": -9, "p": -12}
_PREFIXED = re.compile("(?!cd|Pa)([GMkcmuµnp])(Hz|Pa|mol|Ohm|ohm|[mNVAWJFHKLlC])")  # a prefix, and the unit after it
_TIMED = {**dict.fromkeys(("after", "at", "wait"), ">="), "before": "<"}
_COUNTED = ("elapsed", "temporalCount", "count", "timer")
_REPEATED = ("every", "sample")
_FAR = 100  # characters before a sign that are looked at
_WORD_BEFORE = re.compile(r"([^\W\d]\w*)\s*$")
_NUMBER_BEFORE = re.compile(r"([0-9]+\.?[0-9]*)\s*$")
_INDEX = re.compile(r"\[\s*([0-9]{1,4})\s*\]")


def strange_sign(text: str, at: int, expected: str) -> Fault:
    """The fault of a character that begins no token."""
    for wrong, right in (("=>", ">="), ("=<", "<=")):
        if text.startswith(wrong, at):
            return "HS107", f"`{wrong}` is not an inequality", at, at + 2, f"write `{right}`"
    if text[at] == "=":
        return "HS107", "`=` has no meaning in an expression", at, at + 1, _EQUALS[expected]
    for sign, code, message, hint in _SIGNS:
        if text.startswith(sign, at):
            return code, message, at, at + len(sign), _better(sign, text, at) or hint
    if plain := plain_sign(text[at]):
        return "HS101", told_apart(text[at]), at, at + 1, f"write `{plain}`"
    return "HS101", f"the character `{text[at]}` has no meaning in an expression", at, at + 1, None


def _better(sign: str, text: str, at: int) -> str | None:
    """The right form of the text around a sign, where that is known."""
    word = _WORD_BEFORE.search(text, max(0, at - _FAR), at)
    name = word.group(1) if word else ""
    if sign == "'" and name:
        return f"write {name}: a reset sees the values before the jump, and derivatives are what `flow` gives"
    if sign in "'\"" and not text[at + 1 :].strip():
        return "remove it, or put quotes around the whole value"
    quantity = _QUANTITY.fullmatch(text[:at]) if sign == "^" and at < _FAR else None
    if quantity and quantity.group(3).lower() in _UNITS:
        return f"write {quantity.group(1)} alone: units belong under `units`"
    if sign == "%" and not text[at + 1 :].strip() and (number := _NUMBER_BEFORE.search(text, max(0, at - _FAR), at)):
        return f"write {number.group(1)}/100"
    if sign == "°" and text[at + 1 : at + 2] in ("C", "F"):
        return "leave the unit out: units belong under `units`"
    if sign in ("^", ".^") and name == "e":
        return "write exp(x) for a power of e"
    if sign in ("^", ".^") and name in FUNCTIONS:
        return _power_of(name)
    if sign == "[" and name in FUNCTIONS:
        return f"write {name}(...)"
    index = _INDEX.match(text, at)
    if sign == "[" and name and index:
        return f"write every component as a name of its own: {name}{index.group(1)}"
    return None


def _power_of(function: str) -> str:
    """The hint for ``sin**2(x)``."""
    return f"write {function}(...)**2 for a power of a function"


def missing_operand(tokens: Sequence[Any], at: int) -> Fault:
    """The fault of a token in the place of an operand."""
    token, before = tokens[at], tokens[at - 1] if at else None
    if before is None and token.text == ")":
        return "HS103", "this parenthesis closes nothing", token.start, token.end, "remove it"
    if before is None:
        return "HS102", f"an operand is missing before `{token.text}`", token.start, token.end, None
    if before.text == "(" and token.text == ")":
        return "HS102", "there is nothing between the parentheses", before.start, token.end, None
    hint = f"write what follows `{before.text}`, or remove it"
    if before.text == "**" and token.text == "*":
        hint = "write `**` for a power"
    if before.text == "/" and token.text == "/":
        hint = "write floor(x/y) for a whole quotient, and `#` before a comment"
    return "HS102", f"an operand is missing after `{before.text}`", before.start, before.end, hint


def unexpected(tokens: Sequence[Any], at: int, expected: str, depth: int) -> Fault:
    """The fault of something after an operand that is no operator."""
    before, token = tokens[at - 1], tokens[at]
    if token.text == ")":
        return "HS103", "this parenthesis closes nothing", token.start, token.end, "remove it"
    if token.text != ",":
        return _no_operator(tokens, at)
    hint = "parentheses hold one expression" if depth else "write one expression here"
    if before.kind == tokens[at + 1].kind == "number":
        left, right = shown(before.text), shown(tokens[at + 1].text)
        hint = f"write {left}{right}, or {left}.{right}" if len(tokens[at + 1].text) == 3 else f"write {left}.{right}"
    if expected == "inequality" and not depth:
        hint = "write one inequality here: the rest of a `when` under `if`, of a `domain` as further items"
    return "HS102", "a comma separates only arguments of a function", token.start, token.end, hint


def _no_operator(tokens: Sequence[Any], at: int) -> Fault:
    """Two operands side by side."""
    before, token = tokens[at - 1], tokens[at]
    left, right = shown(before.text, 30), shown(token.text, 30)
    if token.text in _FOREIGN_WORDS or before.text in _FOREIGN_WORDS:
        word = token if token.text in _FOREIGN_WORDS else before
        hint = f"write `{word.text.lower()}`" if word.text.isupper() else CASES
        return "HS109", f"`{word.text}` is not a word of the language", word.start, word.end, hint
    if before.text in FUNCTIONS:
        message = f"`{before.text}` is a function and needs parentheses"
        return "HS112", message, before.start, before.end, f"write {before.text}({right})"
    function, power = tokens[max(0, at - 3)], tokens[max(0, at - 2)]
    if token.text == "(" and function.text in FUNCTIONS and power.text == "**":
        message = f"`{function.text}` is a function and needs parentheses"
        return "HS112", message, function.start, before.end, _power_of(function.text)
    if before.text == ")":
        left = "(...)"
    if token.text == "(":
        right = "(...)"
    message = f"an operator is missing between `{left}` and `{right}`"
    return "HS104", message, before.start, token.end, _joined(before, token, left, right)


def _joined(before: Any, token: Any, left: str, right: str) -> str:
    if before.kind == token.kind == "number":
        if right == "1" and before.end < token.start:  # as in 1.2 1/h
            return f"write {left} alone, for units belong under `units`; or {left}*1 for a product"
        return "a number has one decimal point, and no blanks"
    known = _side_by_side(left, right) if (before.kind, token.kind) == ("number", "name") else _compared(left, right)
    return known or timed(left, right) or f"write {left}*{right} for a product"


def timed(function: str, time: str | None) -> str | None:
    """The hint for ``after(2, sec)`` and the like: the time since a mode was entered is `since` here."""
    if function in _COUNTED:
        return "write since, the time since the mode was entered"
    if function in _REPEATED:
        return f"write since >= {time or 'T'}, in a transition that enters its mode again"
    if function not in _TIMED:
        return None
    limit = f"{_TIMED[function]} {time or 'T'}"
    return f"write since {limit}, the time since the mode was entered; from the start of the run, t {limit}"


def _side_by_side(number: str, name: str) -> str | None:
    """The hint for a number and a name without an operator between, where the name is a unit or an exponent."""
    product = f"{number}*{name} for a product"
    if name in ("deg", "degrees", "rad"):
        return NAMES[name]
    if re.fullmatch("[dD][0-9]{1,4}", name):
        return f"write {number}e{name[1:]}"
    if other := _another_unit_of_time(number, name):
        or_product = f"; or {product}" if len(name) == 1 else ""
        return f"write {number} where t is in {name}, {other}; `units: {{t: {name}}}` says which{or_product}"
    suffixes = TABLES["suffixes"]  # of SPICE
    if power := suffixes.get(name) or suffixes.get(name.lower() if len(name) > 1 else ""):
        scaled = _scaled(number, power)
        units = "; units belong under `units`" if name in _UNITS else ""
        return f"write {scaled} for the suffix {name}, or {product}{units}"
    if name.lower() not in _UNITS:
        return None
    if len(name) == 1:
        return f"write {product}; units belong under `units`"
    if prefixed := _PREFIXED.fullmatch(name):
        prefix, base = prefixed.groups()
        scaled = _scaled(number, _POWERS[prefix])
        return f"write {scaled} with the unit {base}, {number} with {name}: units belong under `units`; or {product}"
    return f"write {number} alone, for units belong under `units`; or {product}"


def _scaled(number: str, power: object) -> str:
    return f"{number}*1e{power}" if re.search("[eE]", number) else f"{number}e{power}"


def _another_unit_of_time(number: str, name: str) -> str | None:
    size = TABLES["seconds"].get(name.rstrip("s") if len(name) > 3 else name)
    if size is None or not _PLAIN_NUMBER.fullmatch(number):
        return None
    factor, unit = (1000, "ms") if size == 1 else (size, "s")
    return f"{float(number) * factor:.12g} where it is in {unit}"


def _compared(left: str, word: str) -> str | None:
    """The hint for a comparison in words."""
    if word in ("crosses", "exceeds", "reaches", "above", "over"):
        return f"write {left} >= and the value"
    return f"write {left} <= and the value" if word in ("below", "under") else None


def unknown_name(name: str, known: Collection[str], measured: bool) -> str | None:
    """What to write for an unknown name; one that is ``measured`` is the factor after a number."""
    unit = "leave the unit out: units belong under `units`" if len(name) > 1 and name.lower() in _UNITS else None
    if measured and unit and closest(name, known) is None:
        return unit
    if name in NAMES:
        return NAMES[name]
    if owned := [n for n in known if n.rpartition(".")[2] == name and n != name]:
        return f"write {' or '.join(owned[:2])}: names of parts have the part in front"
    define = "define it, under `parameters`, `inputs` or `let`"
    near = _derivative_of(name, known) or did_you_mean(name, [*known, *CONSTANTS], define) or ""
    return near + "; a unit belongs under `units`" * bool(unit)


def _derivative_of(name: str, known: Container[str]) -> str | None:
    """The hint for ``dx`` and ``xdot``, where ``x`` is known."""
    match = re.fullmatch(r"d_?(\w+)|(\w+?)_?d?dot|d(\w+)dt", name)
    return NAMES["der"] if match and any(part in known for part in match.groups() if part) else None


def unknown_function(name: str, time: str | None, own: list[str]) -> str:
    """What to write for a function that there is not; ``own`` are those of the file, ``time`` its first argument."""
    near = closest(name, (*own, *FUNCTIONS))
    every = f"functions: {' '.join((*FUNCTIONS, *own))}, and those under `functions`"
    return timed(name, time) or NAMES.get(name) or (f"did you mean '{near}'?" if near else every)


def miscounted(name: str, given: int, fewest: int, most: int | None, example: str) -> tuple[str, str]:
    """The sentence and the hint for a call with too few or too many arguments."""
    number = f"{fewest}" if most == fewest else f"at least {fewest}"
    noun = "argument" if fewest == 1 else "arguments"
    return f"`{name}` takes {number} {noun}, not {given}", _MISCOUNTED.get((name, given)) or f"write {example}"
