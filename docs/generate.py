"""Write the reference pages that the code itself knows: language, command line, integrators, errors, lint rules.

python docs/generate.py           write docs/reference/*.md
python docs/generate.py --check   write nothing; name the pages that are stale and exit 1
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import click
import yaml

from hsdsl import cli, errors, integrators, schema
from hsdsl.defaults import DEFAULT_TOLERANCE, DEFAULTS
from hsdsl.functions import CONSTANTS, FUNCTIONS
from hsdsl.integrators import ButcherTableau
from hsdsl.lint.pages import error_pages
from hsdsl.lint.rules import FAMILIES, RULES, family

REFERENCE = Path(__file__).parent / "reference"
GOLDEN = Path(__file__).parents[1] / "tests" / "golden"
NOTE = "<!-- Written by docs/generate.py: edit the code it reads, not this page. -->\n\n"

LANGUAGE = """# Language

A model is one YAML document. `schemas/model.schema.json` is this page for editors. What a model *means* is on
[its own page](../meaning.md), and how much it may ask for on [another](../security.md).

An *expression* is a number or a text such as `u - 2*a*v - omega**2*x`: numbers, names, `+ - * / **`,
parentheses and functions. An *inequality* has an expression on either side of one of `>= > <= <`.

## Model

"""

DEFAULTS_OF_EXPERIMENT = """## Defaults of `experiment`

A call or an option counts before `--set`, `--set` before the file, the file before these. `step` and `tolerance`
exclude each other: the stronger one removes the other, and a method that only the file names and that cannot
serve gives way to `auto`.

"""

COMMAND_LINE = """# Command line

Answers go to standard output, messages and progress to standard error.

| exit code | meaning |
| --- | --- |
| 0 | the run reached `until` or a final mode; the model has no errors |
| 1 | the model has errors |
| 2 | wrong usage, or a file that cannot be read |
| 3 | the run stopped for [another reason](../meaning.md#m10-stop) |
| 130 | interrupted; what was computed is kept |

"""

ERROR_CODES = """# Error codes

A code keeps its meaning for ever; a retired one is not used again. `hsdsl explain CODE` prints what stands here.
Examples may leave out the keys that every model has.

"""

LINT_RULES = """# Lint rules

`hsdsl lint` looks for what is legal in a model and still probably not meant (warnings), or worth knowing (notes).
`hsdsl explain CODE` prints the page of a rule. How to choose rules and ignore findings is on
[a page of its own](../how-to/lint.md).

"""

INTEGRATORS = """# Integrators

The values of `method` and `--method`. `auto` is chosen for each run, and the run says why: `radau` where the start is
stiff, else `taylor` where every flow is smooth, else `{auto}`, and `{auto}` with a fixed step. A method with an
embedded error estimate is adaptive and keeps a `tolerance`; any method takes fixed steps of size `step`.

"""

TAYLOR = """The coefficients of the solution's own series come from recurrences, and inside a step the polynomial is the
answer. With the tolerance e the order is 3 - log(e)/2, rounded up: 14 for 1e-9, 61 for 1e-50; a fixed step takes the
order of round-off, 22 for float64. Flows must be smooth: with `abs`, `sign`, `min`, `max` or `floor` in one the method
is refused, and a run stops where a flow has a value but no series (the square root of 0)."""

RADAU = """A step is implicit: its increments solve a system of equations, by Newton's method with the derivatives of
the flow, which come from the model's expressions. Derivatives and factored matrices are kept from step to step as long
as they do, and a step keeps its length where it would change by little. The method is L-stable, so that what
decays fast does not bound the step once it has decayed. Inside a step: the collocation polynomial, of degree 3 and
order 3 in general (its error is O(h^4)), exact to order 5 at the step's end. The error estimate falls as h^4 and holds
for the curve between the samples too; right after a switch to a fast decay the steps are therefore short enough to
show it. Where the equations are not solved, the step
is halved. When to take it is in
[theory](../theory.md#stiff-modes)."""

SCALARS = {
    frozenset({"number", "string"}): "expression",
    frozenset({"string", "number", "boolean"}): "text",
    frozenset({"string"}): "text",
    frozenset({"boolean", "string"}): "condition",
    frozenset({"boolean"}): "`true` or `false`",
}

INTERPOLANTS = {
    "secant": "the straight line between its ends",
    "hermite": "the cubic Hermite polynomial of its ends",
    "dense": "dense output of order {order}, from the stages",
}


MISTAKES = """# Typical mistakes

What people write who come from other tools or are new to YAML, and what they are told. Each row is a test: the model at
the end with one passage written as in the row, a file of its own, or a command. The codes are explained on
[their page](errors.md); `hsdsl explain HS106` prints the same.

"""


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Make a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    cells = ([" ".join(text.split()).replace("|", "\\|") for text in row] for row in lines)
    return "".join("| " + " | ".join(row) + " |\n" for row in cells) + "\n"


def language() -> str:
    """Document every key of a model from the JSON Schema."""
    document = schema.json_schema()
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
    """List what an experiment is when nothing is said."""
    for key, value in (DEFAULTS | {"tolerance": DEFAULT_TOLERANCE}).items():
        text = value if isinstance(value, str) else f"{float(value):g}".replace("e-0", "e-").replace("e+0", "e")
        yield f"`{key}`", f"`{text}`"


def callables() -> Iterator[tuple[str, str]]:
    """List what an expression may name beside the model's own names."""
    for name, (_, least, most) in FUNCTIONS.items():
        yield f"`{name}`", f"{least}" if most == least else f"{least} to {most or 'any number'}"
    for name in (*CONSTANTS, "t"):
        yield f"`{name}`", "time" if name == "t" else "constant"


def command_line() -> str:
    """Document every verb and option from the program itself."""
    parts = [COMMAND_LINE]
    context = click.Context(cli.app)
    for name in cli.VERBS:
        command: Any = cli.app.get_command(context, name)
        parts.append(f"## hsdsl {name}\n\n{(command.help or '').strip()}\n\n")
        parameters = [p for p in command.params if p.name != "help"]
        rows = [(as_typed(p), (getattr(p, "help", None) or "").strip()) for p in parameters]
        parts.append(table(("argument or option", "meaning"), rows) if rows else "")
    return "".join(parts)


def as_typed(parameter: Any) -> str:
    """Name a parameter as one would type it."""
    if parameter.param_type_name == "argument":
        return f"`{(parameter.metavar or parameter.name).upper()}`"
    names = ", ".join(f"`{name}`" for name in (*parameter.opts, *parameter.secondary_opts))
    return names if parameter.is_flag else f"{names} `{parameter.metavar or parameter.type.name.upper()}`"


def error_codes() -> str:
    """Document every code of an error."""
    rows = [(f"[`{code}`](#{code.lower()})", text) for code, text in sorted(errors.CODES.items())]
    parts = [f"## {code}\n\n{lowered(page)}\n\n" for code, page in error_pages().items()]
    return ERROR_CODES + table(("code", "about"), rows) + "".join(parts)


def lowered(page: str) -> str:
    """Make the headings of a page those of a part of another."""
    return page.replace("\n## ", "\n### ")


def rule_index() -> str:
    """List every lint rule by family."""
    parts = [LINT_RULES]
    for name in FAMILIES:
        rows = [
            (
                f"[`{code}`](rules/{name}.md#{code.lower()}-{rule.name})",
                rule.name,
                rule.title,
                rule.severity if rule.by_default else "note, on request",
            )
            for code, rule in RULES.items()
            if family(code) == name
        ]
        parts.append(f"## {name.capitalize()}\n\n" + table(("code", "name", "finds", ""), rows) if rows else "")
    return "".join(parts)


def rule_family(name: str) -> str:
    """Document the rules of one family from their docstrings."""
    parts = [f"# Rules: {name}\n\n"]
    for code, rule in RULES.items():
        if family(code) == name:
            parts.append(f"## {code} {rule.name}\n\n{lowered(rule.page)}\n\n")
    return "".join(parts)


def integrator_page() -> str:
    """Document every integrator from its table."""
    methods, taylor, radau = integrators.INTEGRATORS, integrators.METHODS["taylor"], integrators.RADAU
    summary = [
        (f"[`{name}`](#{name})", str(m.order), str(m.stages), "adaptive" if m.adaptive else "fixed")
        for name, m in methods.items()
    ] + [(f"[`{taylor.name}`](#{taylor.name})", "by the tolerance", "", "adaptive")]
    summary.append((f"[`{radau.name}`](#{radau.name})", str(radau.order), "3, implicit", "adaptive"))
    parts = [
        INTEGRATORS.format(auto=integrators.AUTO),
        table(("method", "order", "stages", "steps"), summary),
    ]
    for name, method in methods.items():
        between = INTERPOLANTS[method.interpolant].format(order=method.dense_order)
        error = f"; embedded method of order {method.estimated_order}" if method.adaptive else ""
        error += f", and a coarser one of order {method.estimated_order - 2}" if method.coarse else ""
        known = "" if method.digits is None else f" Coefficients of {method.digits} digits."
        parts.append(f"## {name}\n\n{method.title}, order {method.order}{error}. Inside a step: {between}.{known}\n\n")
        parts.append(f"Source: {method.source}.\n\n{tableau(method)}")
    parts.append(f"## {taylor.name}\n\n{taylor.title}. {TAYLOR}\n\nSource: {taylor.source}.\n")
    parts.append(f"\n## {radau.name}\n\n{radau.title}, order {radau.order}. {RADAU}\n\nSource: {radau.source}.\n")
    return "".join(parts)


def tableau(method: ButcherTableau) -> str:
    """Write a Butcher tableau, and the dense output's weights where there are any."""
    stages = [f"k{i + 1}" for i in range(method.stages)]
    triangle = zip(method.c, method.a, strict=True)
    rows = [weights(f"**{node(c)}**", row) + [""] * (method.stages - len(row)) for c, row in triangle]
    rows.append(weights("**b**", method.b))
    if method.embedded is not None:
        rows.append(weights("**b̂**", method.embedded))
    if method.coarse is not None:
        rows.append(weights("**coarser**", method.coarse))
    text = table(["c", *stages], rows)
    if method.extra:
        extended = [f"k{i + 1}" for i in range(len(method.rows))]
        text += f"{extended[method.stages]} is the flow at the step's end. For the dense output only:\n\n"
        text += table(["c", *extended], [weights(f"**{node(sum(row))}**", row) for row in method.extra])
        stages = extended
    if method.dense is not None:
        text += "Dense output: each stage's weight as a polynomial in s = (t - t_k)/h.\n\n"
        powers = [f"s^{m + 1}" for m in range(len(method.dense[0]))]
        text += table(["stage", *powers], [weights(k, row) for k, row in zip(stages, method.dense, strict=True)])
    return text


def node(value: Any) -> str:
    """Write a fraction, or a decimal where a fraction would be long."""
    return str(value) if value.denominator < 10**20 else f"{float(value):.17g}"


def weights(label: str, row: Iterable[Fraction]) -> list[str]:
    """Make a table row of exact weights."""
    return [label, *(node(value) for value in row)]


def mistakes() -> str:
    """Tabulate what is answered to typical mistakes, from the records that the tests compare with."""
    data = yaml.safe_load((GOLDEN / "mistakes.yaml").read_text(encoding="utf-8"))
    records = (GOLDEN / "mistakes.txt").read_text(encoding="utf-8").split("### ")[1:]
    said = {record.split("\n", 1)[0]: record.split("\n", 1)[1] for record in records}
    parts = [MISTAKES]
    for group, cases in data["groups"].items():
        rows = [(case["title"], written_as(case), answers(said[f"{group}: {case['title']}"])) for case in cases]
        parts.append(f"## {group}\n\n" + table(("mistake", "written", "answer"), rows))
    return "".join(parts) + f"## The model\n\n```yaml\n{data['base']}```\n"


def written_as(case: Mapping[str, Any]) -> str:
    """Show the lines of a mistake that differ from what they should be."""
    if "command" in case:
        return code("hsdsl " + " ".join(case["command"]))
    lines = str(case.get("write", case.get("file"))).splitlines()
    right = str(case.get("for", "")).splitlines()
    wrong = [line for line in lines if line not in right] or lines
    return "<br>".join(code(line.replace("\t", "→")) for line in wrong[:6] if line.strip()) or "nothing"


def code(text: str) -> str:
    """Set a text as code, whatever marks are in it."""
    text = text.strip()
    fence = "``" if "`" in text else "`"
    space = " " if text.startswith("`") or text.endswith("`") else ""
    return f"{fence}{space}{text}{space}{fence}"


def answers(said: str) -> str:
    """Set the messages of a record, each with its hint."""
    found: list[str] = []
    for line in said.splitlines():
        message = re.match(r"[^ ]+:(\d+):(\d+): error (HS\d+): (.*)|(?:hsdsl|Error): (.*)", line)
        if message and message[3]:
            found.append(f"[{message[3]}](errors.md#{message[3].lower()}) {escaped(message[4])}")
        elif message:
            found.append(escaped(message[5]))
        elif line.startswith("  hint: ") and found:
            found[-1] += f"; *{escaped(line[8:])}*"
    return "<br>".join(found)


def escaped(text: str) -> str:
    """Keep signs of a message from being marks of the page."""
    return re.sub(r"([\\*_<\[\]{}]|^`(?=``))", r"\\\1", text) if "`" not in text else parted(text)


def parted(text: str) -> str:
    """As :func:`escaped`, but for what stands between backticks, which is code."""
    if text.count("`") % 2 or "``" in text:
        return re.sub(r"([\\*_<\[\]{}`])", r"\\\1", text)
    pieces = text.split("`")
    return "`".join(escaped(piece) if i % 2 == 0 else piece for i, piece in enumerate(pieces))


PAGES: dict[str, Callable[[], str]] = {
    "language.md": language,
    "command-line.md": command_line,
    "errors.md": error_codes,
    "rules.md": rule_index,
    **{
        f"rules/{name}.md": partial(rule_family, name)
        for name in FAMILIES
        if any(family(code) == name for code in RULES)
    },
    "integrators.md": integrator_page,
    "mistakes.md": mistakes,
}


def render(name: str) -> str:
    """Make the text of one page."""
    return NOTE + PAGES[name]().rstrip() + "\n"


def stale() -> list[str]:
    """Name the pages that differ from what the code says."""
    return [name for name in PAGES if written(name) != render(name)]


def written(name: str) -> str | None:
    """Read a page as it is, None where there is none."""
    file = REFERENCE / name
    return file.read_text(encoding="utf-8") if file.is_file() else None


def main() -> int:
    """Write or check."""
    if "--check" in sys.argv[1:]:
        old = stale()
        for name in old:
            print(f"docs/reference/{name} is stale; run python docs/generate.py", file=sys.stderr)
        return 1 if old else 0
    (REFERENCE / "rules").mkdir(parents=True, exist_ok=True)
    for name in PAGES:
        (REFERENCE / name).write_text(render(name), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
