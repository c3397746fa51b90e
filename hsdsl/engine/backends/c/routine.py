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
from textwrap import dedent

from hsdsl.engine.backends.printer import C_OPERATORS, Language, number_text, stored

_FUNCTION = """\
static int {name}(const hs_real *restrict p, hs_real t, const hs_real *restrict x, hs_real *restrict out) {{
  int bad = 0;
  (void)p, (void)t, (void)x, (void)out;
{body}
  return bad;
}}
"""
_PIECE = """\
static HS_APART int {name}(const hs_real *restrict p, hs_real t, const hs_real *restrict x, hs_real *restrict v,
    hs_real *restrict out) {{
  int bad = 0;
  (void)p, (void)t, (void)x, (void)v, (void)out;
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
static int {name}(const hs_real *restrict p, hs_real t, const hs_real *restrict x, hs_real *restrict out) {{
  hs_real v[{size}];
  return {calls};
}}
"""

_SHAPE = """\
HS_APART
static int NAME(const int *of, const hs_real *restrict p, hs_real t, const hs_real *restrict x,
    hs_real *restrict out) {{
  int bad = 0;
  (void)p, (void)t, (void)x, (void)out;
{body}
  return bad;
}}
"""
_CALL = """\
static int {name}(const hs_real *restrict p, hs_real t, const hs_real *restrict x, hs_real *restrict out) {{
  static const int of[] = {{{of}}};
  return {kind}(of, p, t, x, out);
}}
"""
_OWN_NAME = re.compile(r"\b(?:[a-z]\d+|given\[\d+\])")


def shape_of(text: str, data: Mapping[str, str]) -> tuple[str, tuple[str, ...]]:
    """The text of a routine without the numbers of its operands, and these in C, ``x[0]`` or ``p[0]``.

    Routines of parts that are alike have one shape. None is one that takes all states.
    """
    if not text.startswith("(*given)"):
        return text, ()
    operands: dict[str, int] = {}

    def slot(found: re.Match[str]) -> str:
        name = found[0]
        if name.startswith("given"):
            return "given"
        operand = f"x[{name[1:]}]" if name[0] == "x" else data.get(name)
        if operand is None:  # a name of the routine's own
            return name
        return f"{operand[0]}_{operands.setdefault(operand, len(operands))}"

    return _OWN_NAME.sub(slot, text), tuple(operands)


def shape_function(shape: str, operands: Sequence[str]) -> str:
    """The function ``NAME`` of the routines of one shape, of where their operands are."""
    lines = [line for line in shape.splitlines(keepends=True) if not line.endswith(" = given\n")]
    definition = ast.parse(dedent(f"    def routine{''.join(lines)}")).body[0]
    assert isinstance(definition, ast.FunctionDef)
    names = {f"{operand[0]}_{i}": f"{operand[0]}[of[{i}]]" for i, operand in enumerate(operands)}
    return _SHAPE.format(body=function_body(definition, names | {"t": "t"}))


def call_of_shape(name: str, kind: str, operands: Sequence[str]) -> str:
    """A routine as a call of the function of its shape."""
    return _CALL.format(name=name, kind=kind, of=", ".join(operand[2:-1] for operand in operands))


def routine_function(name: str, text: str, data: Mapping[str, str], apart: bool = False) -> str:
    """A routine, its text being that of a Python function from its arguments on; ``data`` names what it closes over.

    With ``apart`` a value that there is none of is not-a-number, and the others are what they are.
    """
    definition = ast.parse(dedent(f"    def routine{text}")).body[0]
    assert isinstance(definition, ast.FunctionDef)
    names = {**data, **_named(definition)}
    small = _size(definition) <= LARGE
    assignments, locals_ = _assignments(definition, dict(names)) if apart or not small else ([], 0)
    if apart := apart and any("&bad" in one.value for one in assignments):
        assignments, locals_ = _each_apart(assignments, locals_), 2 * locals_
    if small and not apart:
        return _FUNCTION.format(name=name, body=function_body(definition, names))
    if not small:
        return _in_pieces(name, assignments, max(1, locals_), "0" if apart else "bad")
    body = "\n".join(f"  {one.target} = {one.value};" for one in assignments)
    return _APART.format(name=name, size=max(1, locals_), body=body)


def _in_pieces(name: str, assignments: list[Assignment], size: int, status: str) -> str:
    found = pieces(assignments)
    parts = [f"{name}_{i}" for i in range(len(found))]
    bodies = ("\n".join(f"  {statement}" for statement in piece) for piece in found)
    functions = (_PIECE.format(name=part, body=body, status=status) for part, body in zip(parts, bodies, strict=True))
    calls = " || ".join(f"{part}(p, t, x, v, out)" for part in parts)
    return "".join((*functions, _WHOLE.format(name=name, size=size, calls=calls)))


def _failing(assignments: list[Assignment]) -> list[bool]:
    """Whether each value may be none."""
    found: list[bool] = []
    for one in assignments:
        found.append("&bad" in one.value or any(found[i] for i in one.needs))
    return found


def _each_apart(assignments: list[Assignment], locals_: int) -> list[Assignment]:
    """Let each value be none where it, or what it needs, is none: ``v`` has behind the values whether they are lost."""
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


def _assignments(definition: ast.FunctionDef, names: dict[str, str]) -> tuple[list[Assignment], int]:
    """The statements of a routine, with its own names in an array, and how many there are."""
    found: list[Assignment] = []
    own: dict[str, int] = {}

    def add(target: str, value: ast.expr) -> None:
        used = {node.id for node in ast.walk(value) if isinstance(node, ast.Name)}
        found.append(Assignment(target, C.expression_of(value, names), [own[name] for name in used & own.keys()]))

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
    """``target = value;`` behind those that it ``needs``, by their numbers: all of them come before it."""

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
        groups: dict[str, list[Assignment]] = {}
        for one in level:
            groups.setdefault(_OPERAND.sub(_shape, f"{one.target} = {one.value};"), []).append(one)
        for group in groups.values():
            texts = [f"{one.target} = {one.value};" for one in group]
            if len(group) >= LEAST_LIKE:
                yield _loop(texts)
            else:
                yield from (_OPERAND.sub(lambda found: _indexed(found, found[2] or found[3]), text) for text in texts)


def _levels(assignments: Sequence[Assignment]) -> list[list[Assignment]]:
    """Assignments, behind each other only where one needs the other."""
    depth: list[int] = []
    levels: list[list[Assignment]] = []
    for one in assignments:
        depth.append(1 + max((depth[i] for i in one.needs), default=-1))
        if depth[-1] == len(levels):
            levels.append([])
        levels[depth[-1]].append(one)
    return levels


def _shape(found: re.Match[str]) -> str:
    return f"{found[1]}[]" if found[1] else "l" if found[3] else "number"


def _indexed(found: re.Match[str], index: str | None) -> str:
    """An operand, with another index in the place of its own."""
    if found[1]:
        return f"{found[1]}[{index}]"
    return _OWN.format(index) if found[3] else found[4]


def _loop(texts: Sequence[str]) -> str:
    """Statements of one shape as a loop; what is the same in all of them, or goes up evenly, needs no table."""
    matches = [list(_OPERAND.finditer(text)) for text in texts]
    tables: dict[bool, list[list[str]]] = {False: [], True: []}  # of indices, of numbers
    names: list[str] = []
    for column in zip(*matches, strict=True):
        index = column[0][4] is None
        values = [found[2] or found[3] or found[4] for found in column]
        plain = _plain(values) if index else values[0] if len(set(values)) == 1 else None
        if plain is None:
            tables[not index].append(values)
            plain = f"{'of' if index else 'number'}[i][{len(tables[not index]) - 1}]"
        names.append(_indexed(column[0], plain) if index else plain)
    iterator = iter(names)
    body = _OPERAND.sub(lambda _: next(iterator), texts[0])
    declared = "".join(_table(kind, columns) for kind, columns in tables.items() if columns)
    return f"{{ {declared}for (int i = 0; i < {len(texts)}; i++) {body} }}"


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
