"""One routine of a program as a C function, or as one that calls pieces of bounded size.

A compiler takes more than twice as long for a function twice as long. So a large routine is cut into pieces, and
assignments of the same shape, such as those of the masses of a chain, become one loop: what differs between them,
indices and numbers, is data.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from textwrap import dedent

from hsdsl.engine.backends.printer import C_OPERATORS, Language, number_text, stored

_FUNCTION = """\
static int {name}({of}const hs_real *restrict p, hs_real t, const hs_real *restrict x, hs_real *restrict out) {{
  int bad = 0;
  {unused}(void)p, (void)t, (void)x, (void)out;
{body}
  return bad;
}}
"""
_PIECE = """\
static HS_APART int {name}({of}const hs_real *restrict p, hs_real t, const hs_real *restrict x, hs_real *restrict v,
    hs_real *restrict out) {{
  int bad = 0;
  {unused}(void)p, (void)t, (void)x, (void)v, (void)out;
{body}
  return {status};
}}
"""
_APART = """\
static int {name}(const hs_real *restrict p, hs_real t, const hs_real *restrict x, hs_real *restrict out) {{
  hs_real v[{size}];
  int bad = 0;
  (void)p, (void)t, (void)x, (void)v;
{body}
  return 0;
}}
"""
_WHOLE = """\
static int {name}({of}const hs_real *restrict p, hs_real t, const hs_real *restrict x, hs_real *restrict out) {{
  hs_real v[{size}];
  return {calls};
}}
"""

_OF = "const int *of, "
_OWN_NAME = re.compile(r"\b[a-z]\d+")
_GIVEN = re.compile(r"^ +(\w+) = given\[(\d+)\]\n", re.MULTILINE)


def shape_of(text: str, data: dict[str, str]) -> tuple[str, tuple[str, ...]]:
    """The text of a routine of few operands with their places among these as names, and these in C, as ``x[0]``.

    Routines of parts that are alike have one shape.
    """
    given = {name: f"x[{int(place) - 1}]" for name, place in _GIVEN.findall(text) if name != "t"}
    operands: dict[str, int] = {}

    def slot(found: re.Match[str]) -> str:
        operand = given.get(found[0]) or data.get(found[0])
        if operand is None:  # a name of the routine's own
            return found[0]
        return f"{operand[0]}_{operands.setdefault(operand, len(operands))}"

    return _OWN_NAME.sub(slot, _GIVEN.sub("", text)), tuple(operands)


def shape_function(name: str, shape: str, operands: Sequence[str]) -> str:
    """The function of the routines of one shape, of where their operands are."""
    names = {f"{operand[0]}_{i}": f"{operand[0]}[of[{i}]]" for i, operand in enumerate(operands)}
    return routine_function(name, shape, names | {"t": "t"}, few=True)


def routine_function(name: str, text: str, data: Mapping[str, str], apart: bool = False, few: bool = False) -> str:
    """A routine, its text being that of a Python function from its arguments on; ``data`` names what it closes over.

    With ``apart`` a value that there is none of is not-a-number, and the others are what they are. One of ``few``
    operands takes where they are.
    """
    source = dedent(f"    def routine{text}")
    definition = ast.parse(source).body[0]
    assert isinstance(definition, ast.FunctionDef)
    names = {**data, **_named(definition)}
    small, of = _size(definition) <= LARGE, _OF if few else ""
    assignments, locals_ = _assignments(definition, source, dict(names)) if apart or not small else ([], 0)
    if apart := apart and any("&bad" in one.value for one in assignments):
        assignments, locals_ = _each_apart(assignments, locals_), 2 * locals_
    if small and not apart:
        return _FUNCTION.format(name=name, body=function_body(definition, names), of=of, unused="(void)of, " * few)
    if not small:
        return _in_pieces(name, assignments, max(1, locals_), "0" if apart else "bad", of)
    body = "\n".join(f"  {one.target} = {one.value};" for one in assignments)
    return _APART.format(name=name, size=max(1, locals_), body=body)


def _in_pieces(name: str, assignments: list[Assignment], size: int, status: str, of: str) -> str:
    found = pieces(assignments)
    parts = [f"{name}_{i}" for i in range(len(found))]
    bodies = ("\n".join(f"  {statement}" for statement in piece) for piece in found)
    given = {"status": status, "of": of, "unused": "(void)of, " if of else ""}
    functions = (_PIECE.format(name=part, body=body, **given) for part, body in zip(parts, bodies, strict=True))
    calls = " || ".join(f"{part}({'of, ' if of else ''}p, t, x, v, out)" for part in parts)
    return "".join((*functions, _WHOLE.format(name=name, size=size, calls=calls, of=of)))


def _failing(assignments: list[Assignment]) -> list[bool]:
    """Whether each value may be none."""
    found: list[bool] = []
    for one in assignments:
        found.append("&bad" in one.value or any(found[i] for i in one.needs))
    return found


def _each_apart(assignments: list[Assignment], locals_: int) -> list[Assignment]:
    """Let each value be none where it, or what it needs, is none: ``v`` has after the values whether they are lost."""
    fails = _failing(assignments)

    def apart(i: int, one: Assignment) -> Assignment:
        lost = " | ".join(f"(v[{locals_ + k}] != 0)" for k in sorted(one.needs) if fails[k])
        result = f"{one.target} = bad ? (hs_real)NAN : {one.target}"
        kept = f"v[{locals_ + i}] = (hs_real)bad" if i < locals_ else result
        return replace(one, target=f"bad = {lost or 0}, {one.target}", value=f"{one.value}, {kept}")

    return [apart(i, one) if fails[i] else one for i, one in enumerate(assignments)]


def _size(definition: ast.FunctionDef) -> int:
    last = definition.body[-1]
    assert isinstance(last, ast.Return) and isinstance(last.value, ast.Tuple)
    return len(definition.body) - 1 + len(last.value.elts)


def _assignments(definition: ast.FunctionDef, source: str, names: dict[str, str]) -> tuple[list[Assignment], int]:
    """The statements of a routine, with its own names in an array, and how many there are."""
    found: list[Assignment] = []
    own: dict[str, int] = {}
    lines = source.split("\n")

    def add(target: str, value: ast.expr) -> None:
        text = lines[value.lineno - 1][value.col_offset : value.end_col_offset]
        used = own.keys() & _WORD.findall(text)
        found.append(Assignment(target, expression(text, names), [own[name] for name in used]))

    *statements, last = definition.body
    for i, statement in enumerate(statements):
        assert isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name)
        add(f"v[{i}]", statement.value)
        own[statement.targets[0].id] = i
        names[statement.targets[0].id] = f"v[{i}]"
    assert isinstance(last, ast.Return) and isinstance(last.value, ast.Tuple)
    for i, value in enumerate(last.value.elts):
        add(f"out[{i}]", value)
    return found, len(statements)


def _arguments(definition: ast.FunctionDef) -> dict[str, str]:
    if not definition.args.args:
        return {}
    time, *others = (argument.arg for argument in definition.args.args)
    return {time: time} | {name: f"x[{i}]" for i, name in enumerate(others)}


def _named(definition: ast.FunctionDef) -> dict[str, str]:
    """What a routine's arguments are called in C: those of its head, or those that it takes out of all."""
    found = _arguments(definition)
    while definition.body and (match := _taken(definition.body[0])):
        name, i = match
        found[name] = f"x[{i - 1}]" if i else "t"
        del definition.body[0]
    return found


def _taken(part: ast.stmt) -> tuple[str, int] | None:
    """The argument that a statement ``name = given[i]`` names."""
    match part:
        case ast.Assign(targets=[ast.Name(id=name)], value=ast.Subscript(slice=ast.Constant(value=int(i)))):
            return name, i
        case _:
            return None


def literal(value: float) -> str:
    """Write a number without loss."""
    return number_text(value, "NAN", "INFINITY", float.hex)


def constant(value: float) -> str:
    """Write a number of a routine, of the type that it computes with."""
    text = literal(value)
    return text if text.endswith(("NAN", "INFINITY", "INFINITY)")) else f"((hs_real){text.strip('()')})"


C = Language(
    literal=constant,
    assign="const hs_real {name} = {value};",
    results=stored,
    divide="hs_div({left}, {right}, &bad)",
    choose="({test} ? {body} : {other})",
    call="hs_{name}({arguments}, &bad)",
    fold="hs_{name}({left}, {right})",
    truths=("0", "1"),
    operators=C_OPERATORS,
)


_WORD = re.compile(r"\b[a-z_]\w*")


def expression(text: str, names: Mapping[str, str]) -> str:
    """Print an expression; what is written of those that differ in names alone is made once."""
    given: list[str] = []

    def slot(found: re.Match[str]) -> str:
        if (name := names.get(found[0])) is None:
            return found[0]
        given.append(name)
        return f"n{len(given) - 1}"

    first, *rest = _template(_WORD.sub(slot, text))
    return first + "".join(given[int(place)] + after for place, after in zip(rest[::2], rest[1::2], strict=True))


@lru_cache(maxsize=1 << 12)
def _template(text: str) -> list[str]:
    """How an expression is printed, split at its names; each is the place that it has in the text."""
    return C.expression(text, {name: f"@{name[1:]}@" for name in _WORD.findall(text) if name[1:].isdigit()}).split("@")


def function_body(definition: ast.FunctionDef, names: Mapping[str, str]) -> str:
    """Print the body of a routine; ``names`` says what its arguments and data are called in C.

    Raises ValueError: the text is not of the language of routines.
    """
    return "\n".join(f"  {line}" for line in C.body(definition, names))


LARGE = 128  # assignments: fewer are written as they are
LEAST_LIKE = 8  # assignments of one shape that become a loop
LONGEST = 128  # statements of a piece
_OPERAND = re.compile(r"\b([a-z]+)\[(\d+)\]|\bl(\d+)\b|(\(\(hs_real\)-?0x[0-9a-f.p+-]+\))")
_OWN = "(lines + ({}) * length)"  # what l{} means


@dataclass(frozen=True)
class Assignment:
    """``target = value;`` after those that it ``needs``, by their numbers: all of them come before it."""

    target: str
    value: str
    needs: Iterable[int] = ()


def pieces(assignments: Sequence[Assignment]) -> list[list[str]]:
    """The statements of assignments, in pieces; each needs what those before it assign, and its own statements."""
    found: list[list[str]] = [[]]
    for statement in _statements(assignments):
        if len(found[-1]) >= LONGEST:
            found.append([])
        found[-1].append(statement)
    return found


def _statements(assignments: Sequence[Assignment]) -> Iterator[str]:
    for level in _levels(assignments):
        groups: dict[Shape, list[Operands]] = {}
        for one in level:
            shape, operands = _split(f"{one.target} = {one.value};")
            groups.setdefault(shape, []).append(operands)
        for shape, group in groups.items():
            if len(group) >= LEAST_LIKE:
                yield _loop(shape, group)
            else:
                yield from (_joined(shape, operands) for operands in group)


def _levels(assignments: Sequence[Assignment]) -> list[list[Assignment]]:
    """Assignments, one after the other only where one needs the other."""
    depth: list[int] = []
    levels: list[list[Assignment]] = []
    for one in assignments:
        depth.append(1 + max((depth[i] for i in one.needs), default=-1))
        if depth[-1] == len(levels):
            levels.append([])
        levels[depth[-1]].append(one)
    return levels


Shape = tuple[tuple[str, ...], tuple[str | None, ...]]  # the text between operands, and what is indexed; no number is
Operands = tuple[str, ...]  # indices, and numbers


def _split(statement: str) -> tuple[Shape, Operands]:
    parts = _OPERAND.split(statement)
    numbers = parts[4::5]
    kinds = (kind or (None if number else "") for kind, number in zip(parts[1::5], numbers, strict=True))
    values = zip(parts[2::5], parts[3::5], numbers, strict=True)
    return (tuple(parts[::5]), tuple(kinds)), tuple(index or line or number for index, line, number in values)


def _joined(shape: Shape, operands: Operands) -> str:
    """A statement with operands: of an array, of the lines of a tape, whose name is empty, or numbers."""
    (first, *between), kinds = shape
    found = [first]
    for kind, operand, text in zip(kinds, operands, between, strict=True):
        found += (operand if kind is None else f"{kind}[{operand}]" if kind else _OWN.format(operand), text)
    return "".join(found)


def _loop(shape: Shape, group: Sequence[Operands]) -> str:
    """Statements of one shape as a loop; what is the same in all of them, or goes up evenly, needs no table."""
    tables: dict[bool, list[Operands]] = {False: [], True: []}  # of indices, of numbers
    names: list[str] = []
    for kind, values in zip(shape[1], zip(*group, strict=True), strict=True):
        is_number = kind is None
        plain = _plain(values) if not is_number else values[0] if len(set(values)) == 1 else None
        if plain is None:
            tables[is_number].append(values)
            plain = f"{'number' if is_number else 'of'}[i][{len(tables[is_number]) - 1}]"
        names.append(plain)
    declared = "".join(_table(kind, columns) for kind, columns in tables.items() if columns)
    return f"{{ {declared}for (int i = 0; i < {len(group)}; i++) {_joined(shape, tuple(names))} }}"


def _plain(indices: Sequence[str]) -> str | None:
    numbers = list(map(int, indices))
    first, step = numbers[0], numbers[1] - numbers[0]
    if any(number != first + i * step for i, number in enumerate(numbers)):
        return None
    return str(first) if step == 0 else f"{first} + {step} * i"


def _table(numbers: bool, columns: Sequence[Sequence[str]]) -> str:
    rows = ", ".join(f"{{{', '.join(row)}}}" for row in zip(*columns, strict=True))
    kind, name = ("hs_real", "number") if numbers else ("int", "of")
    return f"static const {kind} {name}[][{len(columns)}] = {{{rows}}}; "
