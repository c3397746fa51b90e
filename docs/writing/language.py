"""The page of the language, from the JSON Schema of models."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from writing.markdown import table

from hsdsl.base.defaults import DEFAULT_TOLERANCE, DEFAULTS
from hsdsl.base.functions import CONSTANTS, FUNCTIONS
from hsdsl.language.schema.jsonschema import json_schema

LANGUAGE = """# Language

A model is one YAML document. `schemas/model.schema.json` is this page for editors. What a model *means* is on
[its own page](../meaning.md), and how much it may ask for on [another](../security.md).

An *expression* is a number or a text such as `u - 2*a*v - omega**2*x`: numbers, names, `+ - * / **`,
parentheses and functions. An *inequality* has an expression on either side of one of `>= > <= <`.

`floor`, `sign`, `abs`, `min`, `max` and `atan2` of `t`, parameters and inputs alone switch at boundaries of steps,
[each at its own time](../meaning.md#m9-inputs): `floor(t) - floor(t - 0.01)` is a pulse of 0.01 every second, and
`sign(0.3 - (t - floor(t)))` a pulse width of 30 %. Where they contain a state they are examined within steps.

`since` is [the time since the mode was entered](../meaning.md#m12-time-in-a-mode): `when: since >= 2` leaves a mode
after 2. A transition with `event` in the place of `when` is made where
[a condition turns true](../meaning.md#m13-events). A function of `functions` is [written out](../meaning.md#words)
where it is called: `hill(x, 2)`. The unknowns of `solve` are what
[linear equations](../meaning.md#words) give.

An *output* belongs to the modes in which all its names mean something. One of the whole model is read in each mode with
that mode's own `let`; an output of a mode takes precedence. Elsewhere it has no value: not-a-number in arrays, an
empty cell in tables, `null` in JSON. A final mode without `flow` has the outputs of the mode it is entered from.

## Model

"""

DEFAULTS_OF_EXPERIMENT = """## Defaults of `experiment`

A call or an option counts before `--set`, `--set` before the file, the file before these. `step` and `tolerance`
exclude each other: the stronger one removes the other, and a method that only the file names and that cannot
serve gives way to `auto`.

With `--precision` D the default tolerance of `taylor` is 10^(7 - D), which keeps all digits but seven. Methods of
a fixed order keep 1e-9, since their steps would have to be shorter by orders of magnitude. The summary says how
many digits a tolerance keeps where these are fewer.

"""

SCALARS = {
    frozenset({"number", "string"}): "expression",
    frozenset({"string", "number", "boolean"}): "text",
    frozenset({"string"}): "text",
    frozenset({"boolean", "string"}): "condition",
    frozenset({"boolean"}): "`true` or `false`",
}


def language() -> str:
    """Document every key of a model from the JSON Schema."""
    document = json_schema()
    parts = [LANGUAGE, keys_of(document)]
    for name, node in document.get("$defs", document.get("definitions", {})).items():
        parts.append(f"## {name}\n\n")
        parts.append(f"{node['description']}\n\n" if "description" in node else "")
        parts.append(keys_of(node) if "properties" in node else f"Value: {value_of(node)}.\n\n")
    parts.append(DEFAULTS_OF_EXPERIMENT + table(("key", "default"), defaults()))
    parts.append("## Functions and constants\n\n" + table(("name", "arguments"), callables()))
    return "".join(parts)


def keys_of(node: Mapping[str, Any]) -> str:
    """Tabulate the keys of an object."""
    required = node.get("required", ())
    rows = [
        (f"`{key}`", value_of(value), "yes" if key in required else "", value.get("description", ""))
        for key, value in node["properties"].items()
    ]
    if isinstance(node.get("additionalProperties"), dict):
        rows.append(("any name", value_of(node["additionalProperties"]), "", ""))
    return table(("key", "value", "required", "meaning"), rows)


def value_of(node: Mapping[str, Any]) -> str:
    """Say in words what a JSON Schema node admits."""
    if "$ref" in node:
        name = node["$ref"].rsplit("/", 1)[1]
        return f"[{name}](#{name.lower()})"
    if "const" in node or "enum" in node:
        return " or ".join(f"`{value}`" for value in node.get("enum", [node.get("const")]))
    for union in ("anyOf", "oneOf", "allOf"):
        if union in node:
            words = (value_of(part) for part in node[union] if part != {"type": "null"})
            return " or ".join(dict.fromkeys(words))
    return typed(node)


def typed(node: Mapping[str, Any]) -> str:
    """Say in words what a node with a `type` admits; an empty value is legal wherever a list or a map is."""
    given = node.get("type", "anything")
    kinds = {given} if isinstance(given, str) else set(given) - {"null"}
    if kinds == {"array"}:
        return f"list of {value_of(node.get('items', {}))}"
    if kinds == {"object"} and isinstance(node.get("additionalProperties"), dict):
        return f"map from name to {value_of(node['additionalProperties'])}"
    return SCALARS.get(frozenset(kinds)) or " or ".join(sorted(kinds))


def defaults() -> Iterator[tuple[str, str]]:
    """List the defaults of an experiment."""
    for key, value in (DEFAULTS | {"tolerance": DEFAULT_TOLERANCE}).items():
        text = value if isinstance(value, str) else f"{float(value):g}".replace("e-0", "e-").replace("e+0", "e")
        yield f"`{key}`", f"`{text}`"


def callables() -> Iterator[tuple[str, str]]:
    """List what an expression may name besides the model's own names."""
    for name, (_, least, most) in FUNCTIONS.items():
        yield f"`{name}`", f"{least}" if most == least else f"{least} to {most or 'any number'}"
    for name in (*CONSTANTS, "t"):
        yield f"`{name}`", "time" if name == "t" else "constant"
