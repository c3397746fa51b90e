"""Hints for signs and names of other languages: their right form here."""

from __future__ import annotations

import re
from collections.abc import Container

from hsdsl.base.functions import FUNCTIONS

CASES = "write a mode for each case, or select(c, a, b): a where c > 0, else b; select(t - 1, 1, 0) is a step"
_DEGREES = "angles are in radians: write 30*pi/180 for 30 degrees"
_SAMPLES = "give it as samples, under `inputs`"
_UNIT_NAMES = (
    "s ms us ns min h hr hz khz mhz ghz m mm cm km um kg g mg n kn nm j kj w kw mw v mv kv a ma ohm mh uf nf deg "
    "degc degf c k pa kpa mpa bar psi l ml rpm mol ev sec secs second seconds minute minutes hour hours day days meter "
    "meters metre metres volt volts amp amps watt watts newton newtons kelvin celsius"
)
_UNITS = frozenset(_UNIT_NAMES.split())
_QUANTITY = re.compile(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*((?:[^\W\d]+\s*[*/·]\s*)*)([^\W\d]+)\s*")
_SECONDS = {
    **dict.fromkeys(("s", "sec", "second"), 1),
    **{"ns": 1e-9, "us": 1e-6, "ms": 1e-3},
    **dict.fromkeys(("min", "minute"), 60),
    **dict.fromkeys(("h", "hr", "hour"), 3600),
    **dict.fromkeys(("d", "day"), 86400),
}
_PLAIN_NUMBER = re.compile("[0-9.]{1,20}(?:[eE][-+]?[0-9]{1,2})?")
_SUFFIXES = {"f": -15, "p": -12, "n": -9, "u": -6, "µ": -6, "m": -3, "k": 3, "K": 3, "meg": 6, "G": 9}  # of SPICE
_DERIVATIVE = "a derivative is what `flow` gives a state: write that, or name it under `let`"

_HINTS = {  # what to write instead of names
    "write exp(x) for a power of e, and exp(1) for e itself": "e",
    "write pi": "π PI Pi",
    "write t for the time": "time",
    "the time is t": "tau",
    "every number is finite here": "inf nan",
    "write true for a condition, 1 for a number": "on yes",
    "write false for a condition, 0 for a number": "off no",
    _DEGREES: "deg degrees sind cosd",
    "angles are in radians: leave the unit out": "rad",
    **{f"write a{name}": f"arc{name}" for name in ("sin", "cos", "tan", "tan2", "sinh", "cosh", "tanh")},
    "write tan": "tg",
    "write 1/tan(x)": "cot",
    "write 1/cos(x)": "sec",
    "write 1/sin(x)": "csc",
    "write log": "ln",
    "write log(x)/log(10)": "log10",
    "write log(x)/log(2)": "log2",
    "write log(1 + x)": "log1p",
    "write exp(x) - 1": "expm1",
    "write abs": "fabs",
    "write sign": "sgn signum",
    "write x**y": "pow power",
    "write x**2": "sqr",
    "write x**2; a square wave is sign(sin(x))": "square",
    "write > or >=": "gt geq ge",
    "write < or <=": "lt leq le",
    "a pulse over a share d of each period is (1 + sign(d - t/period + floor(t/period)))/2": "pulse pwm rectpuls",
    "write sqrt(x**2 + y**2)": "norm hypot",
    "write -floor(-x)": "ceil",
    "write floor(x + 1/2)": "round",
    "write floor(x)": "int",
    "write x - y*floor(x/y) for a remainder": "mod fmod rem",
    "write x**(1/3), for x that is not negative": "cbrt",
    "write min(max(x, low), high)": "clip sat saturate limit constrain clamp",
    _DERIVATIVE: "der diff dt",
    "an integral is a state whose flow is the integrand": "integral",
    "nothing is remembered but states; a reset sees the values before the jump": "pre delay edge",
    "a guard fires where it is crossed, in the direction in which the flow leads out": "rising falling cross crossing",
    "a state is set by `reset` in a transition": "reinit",
    _SAMPLES: "interp interp1 lookup",
    "a model has no chance in it; " + _SAMPLES: "rand random randn noise",
    CASES: "if ifelse where piecewise Piecewise heaviside Heaviside step unit_step unitstep",
}
NAMES = {name: hint for hint, names in _HINTS.items() for name in names.split()}
MISCOUNTED = {  # functions by a number of arguments that other languages give them
    ("log", 2): "write log(x)/log(b) for the logarithm to the base b",
    ("atan", 2): "write atan2(y, x)",
}

_OPERATORS = {  # of other languages, by the code of their error: what to write instead
    "HS108": {
        "&&": "`and`",
        "||": "`or`",
        "&": "`and`",
        "|": "`or`, and abs(x) for an absolute value",
        "!": "`not`",
        "~": "`not`",
        "∧": "`and`",
        "∨": "`or`",
        "¬": "`not`",
    },
    "HS106": {".^": "`**` for a power", "^": "`**` for a power"},
    "HS109": {".*": "`*`", "./": "`/`", "%": "x - y*floor(x/y) for a remainder"},
    "HS101": {
        "×": "`*`",
        "·": "`*`",
        "⋅": "`*`",
        "÷": "`/`",
        "≥": "`>=`",
        "≤": "`<=`",
        "≠": "`!=`",
        "²": "`**2`",
        "³": "`**3`",
    },
}
_OTHER_SIGNS = (  # signs, a code, a sentence, the right form
    ("'\"", "HS109", "a quote mark has no meaning in an expression", "names have no quotes"),
    ("[]", "HS109", "nothing is indexed in an expression", "write every component as a name of its own"),
    ("{}", "HS109", "braces have no meaning in an expression", "use parentheses"),
    (".", "HS109", "names have no dots in an expression", "write the name or the function alone: sin(x)"),
    (":", "HS109", "a colon has no meaning in an expression", "write plain arithmetic"),
    (";", "HS109", "a semicolon has no meaning in an expression", "write one expression"),
    ("?", "HS109", "a question mark has no meaning in an expression", CASES),
    ("−–", "HS101", "this is not the minus sign of expressions", "write `-`"),
    ("°", "HS101", "a degree sign has no meaning in an expression", _DEGREES),
    ("\\", "HS101", "a backslash has no meaning in an expression", "write the name alone: omega"),
    ("$", "HS101", "a dollar sign has no meaning in an expression", "write the name alone"),
    ("“”‘’", "HS101", "this is a typographic quote mark", "write plain quotes around the whole value, or none"),
    ("∞", "HS101", "every number is finite here", "write a number"),
    ("√", "HS101", "`√` is not a function of the language", "write `sqrt(x)`"),
)
# signs: their characters, a code, a sentence, the right form; longer signs come before their beginnings
SIGNS = (
    *(
        (sign, code, f"`{sign}` is not an operator of the language", f"write {right}")
        for code, signs in _OPERATORS.items()
        for sign, right in signs.items()
    ),
    *((sign, code, sentence, right) for signs, code, sentence, right in _OTHER_SIGNS for sign in signs),
)

_TIMED = {**dict.fromkeys(("after", "at", "wait"), ">="), "before": "<"}
_COUNTED = ("elapsed", "temporalCount", "count", "timer")
_REPEATED = ("every", "sample")

_FAR = 100  # characters before a sign that are looked at
_WORD_BEFORE = re.compile(r"([^\W\d]\w*)\s*$")
_NUMBER_BEFORE = re.compile(r"([0-9]+\.?[0-9]*)\s*$")
_INDEX = re.compile(r"\[\s*([0-9]{1,4})\s*\]")


def better(sign: str, text: str, at: int) -> str | None:
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
        return power_of(name)
    if sign == "[" and name in FUNCTIONS:
        return f"write {name}(...)"
    index = _INDEX.match(text, at)
    if sign == "[" and name and index:
        return f"write every component as a name of its own: {name}{index.group(1)}"
    return None


def power_of(function: str) -> str:
    """The hint for ``sin**2(x)``."""
    return f"write {function}(...)**2 for a power of a function"


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


def unit(name: str) -> str | None:
    """The hint for a name that is a unit's, and nothing else here."""
    return "leave the unit out: units belong under `units`" if len(name) > 1 and name.lower() in _UNITS else None


def measured(number: str) -> str:
    """The hint for a number and what may be a unit such as ``1/h``."""
    return f"write {number} alone, for units belong under `units`; or {number}*1 for a product"


def side_by_side(number: str, name: str) -> str | None:
    """The hint for a number and a name without an operator between, where the name is a unit or an exponent."""
    if name in ("deg", "degrees", "rad"):
        return NAMES[name]
    if re.fullmatch("[dD][0-9]{1,4}", name):
        return f"write {number}e{name[1:]}"
    if other := _another_unit_of_time(number, name):
        product = f"; or {number}*{name} for a product" if len(name) == 1 else ""
        return f"write {number} where t is in {name}, {other}; `units: {{t: {name}}}` says which{product}"
    power = _SUFFIXES.get(name) or _SUFFIXES.get(name.lower() if len(name) > 1 else "")
    if power:
        scaled = f"{number}*1e{power}" if re.search("[eE]", number) else f"{number}e{power}"
        units = "; units belong under `units`" if name in _UNITS else ""
        return f"write {scaled} for the suffix {name}, or {number}*{name} for a product{units}"
    if name.lower() in _UNITS and len(name) == 1:
        return f"write {number}*{name} for a product; units belong under `units`"
    if name.lower() in _UNITS:
        return f"write {number} alone, for units belong under `units`; or {number}*{name} for a product"
    return None


def _another_unit_of_time(number: str, name: str) -> str | None:
    """What a number of one unit of time is in another."""
    size = _SECONDS.get(name.rstrip("s") if len(name) > 3 else name)
    if size is None or not _PLAIN_NUMBER.fullmatch(number):
        return None
    factor, unit = (1000, "ms") if size == 1 else (size, "s")
    return f"{float(number) * factor:.12g} where it is in {unit}"


def compared(left: str, word: str) -> str | None:
    """The hint for a comparison in words."""
    if word in ("crosses", "exceeds", "reaches", "above", "over"):
        return f"write {left} >= and the value"
    return f"write {left} <= and the value" if word in ("below", "under") else None


def derivative_of(name: str, known: Container[str]) -> str | None:
    """The hint for ``dx`` and ``xdot``, where ``x`` is known."""
    match = re.fullmatch(r"d_?(\w+)|(\w+?)_?d?dot|d(\w+)dt", name)
    return _DERIVATIVE if match and any(part in known for part in match.groups() if part) else None
