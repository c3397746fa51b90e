"""The fields of a document: expressions, names, texts, and the shapes of mappings and lists.

A field keeps its `Scalar`, and so its place. Every refusal is a `PydanticCustomError` whose type is our own code.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal, LiteralString, TypeVar, cast

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    ValidationInfo,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import PydanticCustomError

from hsdsl.base.defaults import COMPLETIONS, SCHEMES
from hsdsl.base.names import WORDS, did_you_mean, is_identifier, shown
from hsdsl.language.expression.scope import RESERVED
from hsdsl.language.source.nodes import ABSENT, Key, Scalar, is_empty

T = TypeVar("T")


def refuse(code: str, message: str, hint: str | None = None) -> PydanticCustomError:
    """The error of a validator."""
    return PydanticCustomError(cast(LiteralString, code), "{message}", {"message": message, "hint": hint})


def _unexpected(expected: str, value: Any, hint: str | None = None, code: str = "HS203") -> PydanticCustomError:
    from hsdsl.language.diagnosis.values import hint_for

    return refuse(code, f"expected {expected}, got {described(value)}", hint or hint_for(expected, value))


def described(value: Any) -> str:
    """A value in a sentence."""
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return "a list"
    return f"'{shown(value.value, 40)}'" if isinstance(value, Scalar) and not is_empty(value) else "nothing"


def _single(value: Any, expected: str) -> Scalar:
    if not isinstance(value, Scalar):
        raise _unexpected(expected, value)
    return value


def _expressed(kind: str, listed: str = "an expression") -> Callable[[Any], Scalar]:
    """A validator for an expression of a kind; ``listed`` is what a list of them should have been."""

    def check(value: Any) -> Scalar:
        if isinstance(value, (dict, list)):
            raise _unexpected(listed if isinstance(value, list) else "an expression", value)
        if is_empty(value):
            raise refuse("HS121", f"{kind} is missing here", kind)
        return _single(value, "an expression")

    return check


_expression = _expressed("a number or an expression")
_condition = _expressed("a condition, such as v > 0", "a condition")
_inequality = _expressed("an inequality, such as x >= 1", "one inequality")
_equation = _expressed("an equation, such as m*a == force")


def _text(value: Any) -> Scalar | None:
    scalar = _single(value, "a text")
    return None if is_empty(scalar) else scalar


def _label(value: Any) -> Scalar:
    scalar = _single(value, "a name")
    if not scalar.value.strip():
        raise refuse("HS205", "a name is missing here")
    return scalar


def _flag(value: Any) -> bool:
    scalar = _single(value, "true or false")
    if scalar.kind != "boolean":
        raise _unexpected("true or false", scalar, code="HS204")
    return scalar.value.lower() == "true"


def _whole(value: Any) -> int:
    scalar = _single(value, "a whole number")
    digits = scalar.value[1:] if scalar.value[:1] in "+-" else scalar.value
    if not (scalar.kind == "number" and digits.isdigit()):
        raise _unexpected("a whole number", scalar, "such as 1 or -2", "HS204")
    if len(digits) > 9:
        raise _unexpected("a whole number of at most 9 digits", scalar, code="HS204")
    return int(scalar.value)


def _priority(value: Any, info: ValidationInfo) -> int | Scalar:
    """A whole number, or an expression where the transition is an event."""
    if info.data.get("event") is None:
        return _whole(value)
    scalar = _expression(value)
    return _whole(scalar) if scalar.kind == "number" and scalar.value.lstrip("+-").isdigit() else scalar


def choice(*words: str) -> Callable[[Any], Scalar]:
    """A validator for one of some words."""

    def check(value: Any) -> Scalar:
        scalar = _single(value, " or ".join(words))
        if scalar.value not in words:
            raise _unexpected(" or ".join(words), scalar, did_you_mean(scalar.value, words), "HS204")
        return scalar

    return check


def _identifier(value: Any) -> Scalar:
    scalar = _single(value, "a word")
    if not is_identifier(scalar.value):
        raise _unexpected("a word", scalar, code="HS204")
    return scalar


def _version(value: Any) -> Scalar:
    scalar = _single(value, "the version of the language")
    if scalar.value != "1":
        raise refuse("HS206", f"{described(scalar)} is not a known version of the language", "write hsdsl: 1")
    return scalar


def _name(key: Any) -> Key:
    if not is_identifier(key):
        raise _no_name(key, "cannot be a name")
    if key in RESERVED:
        kind = "a word of the language" if key in WORDS else "a function"
        kind = {"t": "the time", "pi": "a constant"}.get(key, kind)
        raise refuse("HS205", f"'{key}' is {kind} and cannot be a name", "choose another name")
    return key


def _argument(value: Any) -> Key:
    scalar = _single(value, "a name")
    return Key.at(ABSENT, scalar.place) if scalar.value == ABSENT else _name(Key.at(scalar.value, scalar.place))


def _state_name(key: Any) -> Key:
    if key == "mode":
        raise refuse("HS205", "a state cannot be called 'mode', which `initial` uses", "choose another name")
    return _name(key)


def _mode_name(key: Any) -> Key:
    if not key or any(c.isspace() for c in key):
        raise refuse("HS205", f"'{shown(key)}' cannot be the name of a mode", "a mode's name has no blanks")
    return key


def _any_key(key: Any) -> Key:
    if "=" in key or "(" in key:
        from hsdsl.language.diagnosis.values import assigned

        if assigned(key):
            raise _no_name(key, "is not a name")
    return key


def _no_name(key: str, sentence: str) -> PydanticCustomError:
    from hsdsl.language.diagnosis.values import as_name

    return refuse("HS205", f"'{shown(key)}' {sentence}", as_name(key))


def _is_left_out(value: Any) -> bool:
    return is_empty(value) or (isinstance(value, Scalar) and value.value == ABSENT)


def shaped_as_mapping(value: Any) -> Any:
    """A mapping, empty where the value is left out."""
    if not (_is_left_out(value) or isinstance(value, dict)):
        raise _unexpected("a mapping (name: value)", value)
    return dict[Any, Any]() if _is_left_out(value) else value  # pyright: ignore[reportUnknownVariableType]


def shaped_as_list(value: Any) -> Any:
    """A list, empty where the value is left out."""
    if not (_is_left_out(value) or isinstance(value, list)):
        raise _unexpected("a list", value)
    return [] if _is_left_out(value) else value  # pyright: ignore[reportUnknownVariableType]


def mapping(alias: str | None = None) -> Any:
    """A key whose mapping is empty where it is left out."""
    return Field(default_factory=dict[Any, Any], alias=alias)


def items() -> Any:
    """A key whose list is empty where it is left out."""
    return Field(default_factory=list[Any])


class Document(BaseModel):
    """A mapping with known keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True, defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _shape(cls, value: Any) -> Any:
        return shaped_as_mapping(value)


_NUMBER_OR_TEXT: dict[str, Any] = {"type": ["number", "string"]}
_ANY_SCALAR: dict[str, Any] = {"type": ["string", "number", "boolean", "null"]}

Expression = Annotated[Scalar, PlainValidator(_expression), WithJsonSchema(_NUMBER_OR_TEXT)]
Equation = Annotated[Scalar, PlainValidator(_equation), WithJsonSchema({"type": "string"})]
Inequality = Annotated[Scalar, PlainValidator(_inequality), WithJsonSchema({"type": "string"})]
OptionalExpression = Annotated[Scalar | None, PlainValidator(_expression), WithJsonSchema(_NUMBER_OR_TEXT)]
OptionalCondition = Annotated[
    Scalar | None, PlainValidator(_condition), WithJsonSchema({"type": ["string", "boolean"]})
]
Text = Annotated[Scalar | None, PlainValidator(_text), WithJsonSchema(_ANY_SCALAR)]
Label = Annotated[Scalar, PlainValidator(_label), WithJsonSchema({"type": ["string", "number", "boolean"]})]
OptionalLabel = Annotated[
    Scalar | None, PlainValidator(_label), WithJsonSchema({"type": ["string", "number", "boolean"]})
]
Flag = Annotated[bool, PlainValidator(_flag), WithJsonSchema({"type": "boolean"})]
Whole = Annotated[int, PlainValidator(_whole), WithJsonSchema({"type": "integer"})]
Priority = Annotated[int | Scalar, PlainValidator(_priority), WithJsonSchema({"type": ["integer", "string"]})]
Word = Annotated[Scalar | None, PlainValidator(_identifier), WithJsonSchema({"type": "string"})]
Version = Annotated[Scalar, PlainValidator(_version), WithJsonSchema({"const": 1})]


def _words(*words: str) -> WithJsonSchema:
    return WithJsonSchema({"type": "string", "enum": list(words)})


Scheme = Annotated[Scalar | None, PlainValidator(choice(*SCHEMES)), _words(*SCHEMES)]
Completion = Annotated[Scalar | None, PlainValidator(choice(*COMPLETIONS)), _words(*COMPLETIONS)]
Hold = Annotated[
    Literal["zero", "linear"],
    PlainValidator(lambda value: choice("zero", "linear")(value).value),
    _words("zero", "linear"),
]
ValuesOf = Annotated[
    Literal["trigger", "execution"],
    PlainValidator(lambda value: choice("trigger", "execution")(value).value),
    _words("trigger", "execution"),
]

Name = Annotated[Key, PlainValidator(_name), WithJsonSchema({"type": "string"})]

StateName = Annotated[Key, PlainValidator(_state_name), WithJsonSchema({"type": "string"})]
ModeName = Annotated[Key, PlainValidator(_mode_name), WithJsonSchema({"type": "string"})]
ArgumentName = Annotated[Key, PlainValidator(_argument), WithJsonSchema({"type": "string"})]
AnyKey = Annotated[Key, PlainValidator(_any_key), WithJsonSchema({"type": "string"})]

Table = Annotated[dict[Name, T], BeforeValidator(shaped_as_mapping)]
StateTable = Annotated[dict[StateName, T], BeforeValidator(shaped_as_mapping)]
ModeTable = Annotated[dict[ModeName, T], BeforeValidator(shaped_as_mapping)]
OpenTable = Annotated[dict[AnyKey, T], BeforeValidator(shaped_as_mapping)]
Items = Annotated[list[T], BeforeValidator(shaped_as_list)]
