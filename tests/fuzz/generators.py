"""Random inputs of three kinds, each from one `random.Random`: bytes, expressions, and whole documents.

A third of each kind is made from nothing, by the grammar; the others are seeds that were damaged.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from itertools import islice
from random import Random
from typing import Any

import yaml

from fuzz import seeds

MOST_PLACES = 5_000  # of a tree that still is mutated
VARIABLES = ("x", "v", "y", "a", "c", "u", "t", "pi", "k")
FUNCTIONS = (
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "exp",
    "log", "sqrt", "abs", "sign", "floor", "min", "max",
)  # fmt: skip
NUMBERS = (
    "0", "1", "2", "3", "0.5", "1/3", "-1", "1e-3", "1e308", "1e-308", "1e400", "1e-400", "999", "1000", "1001", "1e18",
    "1e19", "9" * 30, "9" * 1001, "0x10", "0o17", "1_000", "1e99999999999", ".5", "5.", "1.7976931348623157e308",
    "4.9e-324", ".inf", ".nan", "-.inf", "1.5e3", "0.1", "010", "1,5", "²", "pi", "0.30000000000000004", "1e1000000",
)  # fmt: skip
EXPONENTS = ("2", "3", "-1", "0.5", "1/3", "1000", "-7", "x", "(a+1)", "0")
TOKENS = (
    "+", "-", "*", "/", "**", "(", ")", ",", "<", "<=", ">", ">=", "==", "=", "!=", "!", "&&", "||", "^", "%", "and",
    "or", "not", "true", "false", "if", "else", "'", '"', "[", "]", "{", "}", ".", ":", ";", "?", "@", "#", "$", "\\",
    "\t", "\n", " ", "\u00a0", "−", "×", "²", "≥", "π", "\u202e", "\x00", "𝑥", "_", "`", "~", "|", "&", "//", "<<",
    "->", "=>",
)  # fmt: skip
KEYS = (
    "x", "v", "flow", "when", "to", "if", "let", "domain", "file", "modes", "outputs", "transitions", "reset",
    "initial", "direction", "<<", "",
)  # fmt: skip
YAML_TOKENS = (
    "{", "}", "[", "]", ":", ": ", ", ", "- ", "? ", "#", " #", "&a ", "*a", "!", "!!str ", "|", ">", "'", '"', "%",
    "@", "`", "\n", "\t", "  ", "---\n", "...\n", "\r\n", "<<: *a", "~", "null", "true", "yes", "on", ".nan", "\\x41",
    "\ufeff", "\u2028",
    "hsdsl: 1\n", "modes:", "flow:", "when:", "to:", "reset:", "initial:", "experiment:", "{x: {", "&b [*a, *a]",
    "!!python/object/apply:os.system ['touch hsdsl_canary']", "%YAML 1.1\n", "%TAG ! tag:x,2000:\n", "!<tag:yaml.org>",
)  # fmt: skip


def expression(rng: Random) -> str:
    """One expression, or something near one."""
    kind = rng.random()
    if kind < 0.45:
        text = grown(rng, rng.choice((1, 2, 2, 3, 3, 4, 6)))
        return compared(rng, text) if rng.random() < 0.25 else text
    if kind < 0.9:
        text = rng.choice(seeds.expressions()) if rng.random() < 0.6 else grown(rng, 3)
        for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
            text = damaged(rng, text)
        return text
    if kind < 0.96:
        return tower(rng)
    return rng.choice((rng.choice(seeds.PAYLOADS), soup(rng, TOKENS + VARIABLES + FUNCTIONS + NUMBERS)))


def grown(rng: Random, depth: int) -> str:
    """A legal expression of the grammar, of names that there are or are not."""
    if depth == 0 or rng.random() < 0.1:
        kind = rng.random()
        if kind < 0.55:
            return rng.choice(VARIABLES)
        return rng.choice(NUMBERS[:10]) if kind < 0.93 else rng.choice(NUMBERS + seeds.NAMES)
    kind = rng.random()
    if kind < 0.5:
        operator = rng.choice(("+", "-", "*", "/", " - ", " + ", "*", "/"))
        return f"{grown(rng, depth - 1)}{operator}{grown(rng, depth - 1)}"
    if kind < 0.6:
        return f"({grown(rng, depth - 1)})**{rng.choice(EXPONENTS)}"
    if kind < 0.7:
        return f"({grown(rng, depth - 1)})"
    if kind < 0.76:
        return f"-{grown(rng, depth - 1)}"
    function = rng.choice(FUNCTIONS)
    count = 2 if function in ("atan2", "min", "max") else 1
    if rng.random() < 0.04:
        count = rng.randint(0, 4)
    return f"{function}({', '.join(grown(rng, depth - 1) for _ in range(count))})"


def compared(rng: Random, left: str) -> str:
    """A condition with an expression in it."""
    text = f"{left} {rng.choice(('<', '<=', '>', '>=', '==', '!='))} {grown(rng, 2)}"
    while rng.random() < 0.35:
        text += rng.choice((" and ", " or ", " < ", " and not ")) + grown(rng, 1) + rng.choice(("", " > 0"))
    return f"not ({text})" if rng.random() < 0.1 else text


def tower(rng: Random) -> str:
    """Something small that asks for something large: nests, chains, powers of powers."""
    n = rng.choice((3, 10, 30, 99, 101, 200, 201, 400, 1500))
    part = grown(rng, rng.choice((0, 1, 1, 2)))
    function = rng.choice(FUNCTIONS)
    return rng.choice(
        (
            lambda: "(" * n + part + ")" * n,
            lambda: f"{function}(" * n + part + ")" * n,
            lambda: rng.choice(("+", "*", "-", "/", " + sin(x)*", "*(1+x)*", "**")).join([part] * n),
            lambda: "**".join([rng.choice(("2", "x", "9", "(1+x)"))] * min(n, 40)),
            lambda: f"({part}+x+v)**{n}",
            lambda: f"(({part})**{n})**{n}",
            lambda: "-" * n + part,
            lambda: "not " * n + "x > 1",
            lambda: f"min({', '.join(f'x*{i}' for i in range(n))})",
            lambda: "max(x, min(v, " * (n // 2) + part + "))" * (n // 2),
            lambda: f"exp({n}*log({part}))",
            lambda: "exp(exp(" * 5 + f"{n}" + "))" * 5,
            lambda: " and ".join(["x > 1"] * n),
            lambda: "sqrt(2)" + "+sqrt(3)" * n,
            lambda: " + ".join(f"1/{2 * i + 3}" for i in range(n)),
            lambda: "*".join(f"(x+{i})" for i in range(n)),
        )
    )()


def damaged(rng: Random, text: str) -> str:
    """A text after one mutation."""
    at = rng.randint(0, len(text))
    end = min(len(text), at + rng.choice((0, 1, 1, 2, 5, 20)))
    kind = rng.random()
    if kind < 0.35:
        return text[:at] + rng.choice(TOKENS + VARIABLES + FUNCTIONS) + text[end:]
    if kind < 0.5:
        return text[:at] + rng.choice(NUMBERS) + text[end:]
    if kind < 0.6:
        return text[:at] + text[end:]
    if kind < 0.7:
        return text[:at] + text[at:end] * rng.choice((2, 3, 50)) + text[end:]
    if kind < 0.8:
        return text[:at] + rng.choice(seeds.expressions()) + text[end:]
    if kind < 0.9:
        return text[:at] + rng.choice(seeds.NAMES + seeds.PAYLOADS) + text[end:]
    return text[:at] + chr(rng.choice((rng.randrange(128), rng.randrange(0x3000), rng.randrange(0x11000)))) + text[end:]


def soup(rng: Random, words: tuple[str, ...]) -> str:
    """Words in a row."""
    return rng.choice(("", " ", " ")).join(rng.choice(words) for _ in range(rng.randint(1, 30)))


def raw(rng: Random) -> bytes:
    """The bytes of a file."""
    kind = rng.random()
    if kind < 0.04:
        return rng.randbytes(rng.randint(0, 300))
    if kind < 0.1:
        return soup(rng, YAML_TOKENS + VARIABLES).encode("utf-8", "surrogatepass")
    data = rng.choice(seeds.documents()) if kind < 0.9 else document(rng)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6, 20))):
        data = mutated(rng, data)
    return data


def mutated(rng: Random, data: bytes) -> bytes:
    """The bytes of a file after one mutation."""
    at = rng.randint(0, len(data))
    end = min(len(data), at + rng.choice((0, 1, 1, 2, 5, 20, 200)))
    kind = rng.random()
    if kind < 0.25:
        inserted = rng.choice(YAML_TOKENS + TOKENS + NUMBERS + seeds.PAYLOADS).encode("utf-8", "surrogatepass")
        return data[:at] + inserted + data[end:]
    if kind < 0.35:
        return data[:at] + data[end:]
    if kind < 0.42:
        return data[:at] + data[at:end] * rng.choice((2, 2, 3, 60)) + data[end:]
    if kind < 0.5:
        other = rng.choice(seeds.documents())
        begin = rng.randint(0, len(other))
        return data[:at] + other[begin : begin + rng.choice((5, 40, 300))] + data[end:]
    if kind < 0.55:
        return data[:at]
    if kind < 0.62:
        return data[:at] + rng.randbytes(rng.randint(1, 4)) + data[end:]
    if kind < 0.7 and at < len(data):
        return data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :]
    return _lines(rng, data)


def _lines(rng: Random, data: bytes) -> bytes:
    lines = data.split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(6):
        case 0:
            lines[i], lines[j] = lines[j], lines[i]
        case 1:
            lines[i] = b" " * rng.choice((1, 2, 4)) + lines[i]
        case 2:
            lines[i] = lines[i].lstrip()
        case 3:
            del lines[i]
        case 4:
            lines.insert(j, lines[i])
        case _:
            key, colon, _ = lines[i].partition(b":")
            lines[i] = key + colon + b" " + expression(rng).encode("utf-8", "surrogatepass")
    return b"\n".join(lines)


def document(rng: Random) -> bytes:
    """A whole model, by the grammar or from a seed whose values moved about."""
    tree = model(rng) if rng.random() < 0.4 else _seed_tree(rng)
    for _ in range(rng.choice((0, 0, 0, 0, 1, 1, 1, 2, 4))):
        tree = moved(rng, tree)
    return written(rng, tree).encode("utf-8", "surrogatepass")


def _seed_tree(rng: Random) -> Any:
    files = seeds.documents(legal=rng.random() < 0.85)
    for _ in range(8):
        try:
            tree = yaml.load(rng.choice(files), Loader=yaml.CBaseLoader)
        except (yaml.YAMLError, ValueError):
            continue
        if isinstance(tree, dict) and _size(tree) < 2000:
            return tree
    return model(rng)


def _size(tree: Any) -> int:
    parts = tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list) else ()
    return 1 + sum(map(_size, parts))


def model(rng: Random) -> dict[str, Any]:
    """A model that is mostly legal."""
    odd = rng.random() < 0.3
    modes = [
        rng.choice(seeds.NAMES if odd else ("free", "A", "on", "off", "D0", "m")) for _ in range(rng.randint(1, 3))
    ]
    states = rng.sample(seeds.NAMES if rng.random() < 0.3 else ("x", "v", "y", "omega", "E"), rng.randint(1, 3))
    names = {"states": states, "modes": modes}
    made: dict[str, Any] = {"hsdsl": "1", "parameters": {"a": _constant(rng), "c": _constant(rng), "k": "a*2 + c"}}
    made["inputs"] = {"u": _input(rng) if rng.random() < 0.4 else "sin(t)"}
    if rng.random() < 0.3:
        made["let"] = {"w": _with(rng, grown(rng, 2), states), "z": "w*w + a"}
    made["modes"] = {mode: _mode(rng, **names) for mode in modes}
    if rng.random() < 0.3:
        made["outputs"] = {"out": _with(rng, grown(rng, 2), states)}
    made["initial"] = {"mode": modes[0], **{state: _constant(rng) for state in states}}
    made["experiment"] = {"until": rng.choice(("1", "1", "10", "2*pi", "0", "1e9", "a", "1e-9"))}
    for key, values in _SETTINGS.items():
        if rng.random() < 0.12:
            made["experiment"][key] = rng.choice(values)
    return made


_SETTINGS = {
    "step": ("1e-2", "0.1", "1e-300", "1e6", "-1", "0", "a"),
    "tolerance": ("1e-6", "1e-15", "1", "1e-300"),
    "method": ("euler", "rk4", "dopri5", "auto", "heun", "ode45"),
    "relaxation": ("1e-6", "1e-2", "10", "1e-30"),
    "scheme": ("relaxed", "located", "paoli-schatzman"),
    "samples": ("2", "100", "1e9", ["0", "0.5", "1"], ["1", "0"]),
    "max_transitions": ("0", "3", "1e6"),
}


def _constant(rng: Random) -> str:
    plain = ("0", "1", "-1", "0.5", "1/3", "2*pi", "sqrt(2)", "exp(1)", "-0.25", "1e-3")
    return rng.choice(plain if rng.random() < 0.93 else (*NUMBERS, "a", "1/0", "0**-1", "tan(pi/2)", "log(0)"))


def _input(rng: Random) -> Any:
    return rng.choice(
        (
            "20*cos(2.5*t)",
            {"times": ["0", "0.5", "1"], "values": ["1", "-1", "0"], "hold": rng.choice(("zero", "linear", "cubic"))},
            {"file": rng.choice(("u.csv", "empty.csv", "binary.csv", "missing.csv", *seeds.PAYLOADS[-8:]))},
            {"times": ["0"] * 3, "values": ["1"]},
            grown(rng, 3),
        )
    )


def _mode(rng: Random, states: list[str], modes: list[str]) -> dict[str, Any]:
    made: dict[str, Any] = {"flow": {state: _field(rng, states) for state in states}}
    if rng.random() < 0.2:
        made["domain"] = [f"{states[0]} <= {rng.choice(NUMBERS[:6])}"]
    made["transitions"] = [_transition(rng, states, modes) for _ in range(rng.randint(0, 3))]
    return made


def _field(rng: Random, states: list[str]) -> str:
    plain = ("1", "-1", f"-{states[0]}", f"{states[-1]} - a", "u", f"a*{states[0]}*(1 - {states[-1]})", "sin(t)")
    return rng.choice(plain) if rng.random() < 0.7 else _with(rng, grown(rng, 3), states)


def _with(rng: Random, text: str, states: list[str]) -> str:
    """An expression in the states that there are, mostly."""
    if rng.random() < 0.1:
        return text
    return _VARIABLE.sub(lambda match: rng.choice(states), text)


_VARIABLE = re.compile(r"\b[xvy]\b")


def _transition(rng: Random, states: list[str], modes: list[str]) -> dict[str, Any]:
    left = rng.choice(states) if rng.random() < 0.7 else _with(rng, grown(rng, 2), states)
    made: dict[str, Any] = {"when": f"{left} {rng.choice(('>=', '<=', '>', '<'))} {rng.choice(NUMBERS[:7])}"}
    made["to"] = rng.choice(modes)
    if rng.random() < 0.3:
        made["if"] = _with(rng, compared(rng, rng.choice(states)), states)
    if rng.random() < 0.5:
        made["reset"] = {state: _field(rng, states) for state in states}
    if rng.random() < 0.2:
        made["priority"] = rng.choice(("1", "-1", "1e9", "high"))
    return made


def moved(rng: Random, tree: Any) -> Any:
    """A tree after one mutation of its structure; one that has grown large stays as it is."""
    places = list(islice(_places(tree), MOST_PLACES))
    if len(places) == MOST_PLACES:
        return tree
    holder, key = rng.choice(places) if places else ({"": tree}, "")
    other_holder, other = rng.choice(places) if places else ({"": tree}, "")
    value = holder[key]
    changes: tuple[Callable[[], Any], ...] = (
        lambda: expression(rng),
        lambda: expression(rng),
        lambda: grown(rng, 2),
        lambda: rng.choice(NUMBERS + seeds.PAYLOADS + seeds.NAMES),
        lambda: json.loads(json.dumps(other_holder[other])),
        lambda: [value],
        lambda: {"x": value},
        lambda: None,
        lambda: [value] * rng.choice((2, 30)),
    )
    kind = rng.random()
    if kind < 0.7:
        holder[key] = rng.choice(changes)()
    elif isinstance(holder, dict) and kind < 0.85:
        name = rng.choice(
            (*seeds.NAMES, "x", "v", "flow", "when", "to", "if", "let", "domain", "file", "modes", "<<", "")
        )
        holder[name] = holder.pop(key)
    elif isinstance(holder, dict):
        del holder[key]
    return tree


def _places(tree: Any) -> Any:
    pairs = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in list(pairs):
        yield tree, key
        yield from _places(value)


def written(rng: Random, tree: Any, indent: int = 0) -> str:
    """A tree as YAML, in a random style."""
    if not isinstance(tree, (dict, list)):
        return _scalar(rng, tree)
    if indent > 8 or rng.random() < 0.15 or not tree:
        return _flow(rng, tree)
    blank = "\n" + " " * indent
    step = rng.choice((2, 2, 2, 4))
    parts = []
    for key, value in tree.items() if isinstance(tree, dict) else ((None, v) for v in tree):
        head = "-" if key is None else f"{_scalar(rng, key)}:"
        inner = written(rng, value, indent + step)
        parts.append(f"{head}{inner}" if inner.startswith("\n") else f"{head} {inner}")
    return (blank if indent else "") + blank.join(parts) + ("" if indent else "\n")


def _flow(rng: Random, tree: Any) -> str:
    if isinstance(tree, dict):
        return "{" + ", ".join(f"{_scalar(rng, k)}: {_flow(rng, v)}" for k, v in tree.items()) + "}"
    if isinstance(tree, list):
        return "[" + ", ".join(_flow(rng, v) for v in tree) + "]"
    return _scalar(rng, tree, plain=0.6)


def _scalar(rng: Random, value: Any, plain: float = 0.97) -> str:
    if value is None:
        return ""
    text = str(value)
    awkward = any(c in text for c in "\n#{}[]&*!|>'\"%@`,") or text.strip() != text or ": " in text
    if rng.random() < (0.05 if awkward else plain):
        return text
    return json.dumps(text) if rng.random() < 0.8 else "'" + text.replace("'", "''").replace("\n", " ") + "'"
