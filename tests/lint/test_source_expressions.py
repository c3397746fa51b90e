"""Expressions of a file: none that the schema knows is left out, and units look at each."""

from collections.abc import Iterator
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from hsdsl.analysis.lint.source_expressions import Role, written
from hsdsl.analysis.lint.units import Units
from hsdsl.language.schema import documents as schema
from hsdsl.language.schema import fields, read
from hsdsl.language.schema.fields import Document
from hsdsl.language.source import ABSENT, Composer, Scalar, decode

OF_EXPRESSIONS = (
    *(fields.Expression, fields.OptionalExpression, fields.OptionalCondition),
    *(fields.Inequality, fields.Equation, fields.Priority),
)
_READERS = {one.__metadata__[0].func for one in OF_EXPRESSIONS}


def is_expression(hint: Any) -> bool:
    """Whether a hint is that of an expression, as a field or as one form of it."""
    return any(getattr(one, "func", None) in _READERS for one in getattr(hint, "__metadata__", ()))


# every expression is metres and seconds; what is written differently has the field's other forms
WHOLE = """
hsdsl: 1
parameters:
  xm: 1
  xs: 2
  a: xm + xs
  b: {value: 3*(xm + xs), min: xm + xs - 9, max: 2*(xm + xs)}
functions: {f: {of: [z], is: z*(xm + xs)}}
inputs:
  u: xm + xs
  v: {times: [xm + xs], values: [xs - xm]}
let: {c: xm + xs}
solve: {unknowns: [d], equations: [xm + xs == d]}
modes:
  m:
    let: {e: xm + xs}
    solve: {unknowns: [g], equations: [xm - xs == g]}
    flow: {x: xm + xs}
    domain: [xm + xs >= 0]
    outputs: {o: xm + xs}
    transitions:
      - {when: xm + xs >= 1, if: xm + xs > 0, to: m, reset: {x: xm + xs}}
      - {event: xm + xs >= 1, delay: xm + xs, priority: xm + xs}
outputs: {p: xm + xs}
scene:
  - {point: [xm + xs, xs - xm]}
  - {line: [[xm + xs, xm - xs], [xm + xs, xm - xs]]}
  - {spring: [[xm + xs, xm - xs], [xm + xs, xm - xs]]}
  - {circle: [xm + xs, xm - xs], radius: xs + xm}
  - {box: [xm + xs, xm - xs], width: xs + xm, height: xs + xm, angle: xs + xm}
  - {view: [xm + xs, xm - xs], width: xs + xm, height: xs + xm}
units: {xm: m, xs: s, t: s}
initial: {mode: m, x: START}
experiment:
  until: xm + xs
  step: xm + xs
  tolerance: xm + xs
  relaxation: xm + xs
  max_transitions: xm + xs
  samples: SAMPLES
  scale: {x: xm + xs}
reference:
  set: {initial.x: xm + xs, b: xm - xs}
  trust: xm + xs
  transitions: [xm + xs, {time: xm + xs, before: {x: xm + xs}, after: {x: xm - xs}}]
  states: [{time: xm + xs, x: xm - xs}]
"""


def documents():
    for samples in ("xm + xs", "[xm + xs, xm - xs]", "{every: xm + xs}"):
        start = "xm + xs" if samples == "xm + xs" else "{min: xm - xs, max: xm + xs}"
        text = decode("whole.yaml", WHOLE.replace("SAMPLES", samples).replace("START", start).encode())
        yield read(Composer(text).document())


def held(value: Any, hint: Any, seen: set[tuple[str, str]]) -> Iterator[Scalar]:
    """The expressions in a value of a document, by the type hint of its field; ``seen`` gathers fields."""
    if is_expression(hint):
        yield from [value] if isinstance(value, Scalar) and value.value != ABSENT else []
        return
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        yield from held(value, inner[0], seen)
    elif origin in (Union, UnionType):
        for one in inner:
            if one is not NoneType and fits(value, one):
                yield from held(value, one, seen)
    elif origin is list and isinstance(value, list):
        for item in value:
            yield from held(item, inner[0], seen)
    elif origin is dict and isinstance(value, dict):
        for item in value.values():
            yield from held(item, inner[1], seen)
    elif isinstance(value, Document):
        for name, hint in hints(type(value)).items():
            found = list(held(getattr(value, name), hint, seen))
            seen |= {(type(value).__name__, name)} if found else set()
            yield from found


def fits(value: Any, hint: Any) -> bool:
    """Whether a value is of one alternative of a union."""
    while get_origin(hint) is Annotated and not is_expression(hint):
        hint = get_args(hint)[0]
    if is_expression(hint):
        return isinstance(value, Scalar)
    if get_origin(hint) in (Union, UnionType):
        return any(fits(value, one) for one in get_args(hint))
    return isinstance(value, get_origin(hint) or hint)


def hints(document: type[Document]) -> dict[str, Any]:
    """The hints of a document's fields, and of its further keys."""
    found = get_type_hints(document, include_extras=True)
    return {name: found[name] for name in (*document.model_fields, "__pydantic_extra__") if name in found}


def expecting(hint: Any, owner: str, name: str, done: set[type]) -> Iterator[tuple[str, str]]:
    """The fields of expressions that a hint leads to: (document, field)."""
    if is_expression(hint):
        yield owner, name
    elif isinstance(hint, type) and issubclass(hint, Document):
        if hint not in done:
            done.add(hint)
            for field, inner in hints(hint).items():
                yield from expecting(inner, hint.__name__, field, done)
    elif get_origin(hint) is not Literal:
        for inner in get_args(hint):
            if not isinstance(inner, str):
                yield from expecting(inner, owner, name, done)


def test_every_expression_of_the_schema_is_among_those_of_a_file():
    seen: set[tuple[str, str]] = set()
    for document in documents():
        places = sorted(str(scalar.place.span) for scalar in held(document, schema.ModelDocument, seen))
        assert sorted(str(e.scalar.place.span) for e in written(document)) == places
    assert set(expecting(schema.ModelDocument, "", "", set())) <= seen


def test_roles_are_those_of_files():
    assert {e.role for document in documents() for e in written(document)} == set(get_args(Role))


def test_units_look_at_every_expression():
    for document in documents():
        expressions = tuple(written(document))
        checked = Units(document, expressions).checked
        apart = {e.role for e in expressions} - {c.written.role for c in checked}
        assert apart == {"function"}  # which have units where they are called
        unseen = [c.written for c in checked if not c.misfits]
        assert [e.scalar.value for e in unseen if "+" in e.scalar.value or "-" in e.scalar.value] == []
