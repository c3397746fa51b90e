"""What stands at the ends of a document: expressions, names, texts, and the shapes of mappings and lists.

A leaf keeps its `Scalar`, and so its place. Every refusal is a `PydanticCustomError` whose type is our own code.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal, LiteralString, TypeVar, cast

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainValidator, WithJsonSchema, model_validator
from pydantic_core import PydanticCustomError

from hsdsl.expression.scope import RESERVED
from hsdsl.names import WORDS, did_you_mean, is_identifier, shown
from hsdsl.schema.forms import as_list, as_mapping, as_name, assigned, in_brackets
from hsdsl.source import ABSENT, Key, Scalar

T = TypeVar("T")


def refuse(code: str, message: str, hint: str | None = None) -> PydanticCustomError:
    """The error of a validator."""
    return PydanticCustomError(cast(LiteralString, code), "{message}", {"message": message, "hint": hint})


def described(value: Any) -> str:
    """What a value is, for a sentence."""
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return "a list"
    if isinstance(value, Scalar) and value.kind != "null":
        return f"'{shown(value.value, 40)}'"
    return "nothing"


def _single(value: Any, wanted: str) -> Scalar:
    if not isinstance(value, Scalar):
        hint = in_brackets(value) if isinstance(value, list) else None
        raise refuse("HS203", f"{wanted} is wanted here, not {described(value)}", hint)
    return value


def _expression(value: Any, kind: str = "a number or an expression") -> Scalar:
    if isinstance(value, (dict, list)):
        hint = in_brackets(value) or "write every component as a name of its own"
        raise refuse("HS203", f"an expression is wanted here, not {described(value)}", hint)
    if isinstance(value, Scalar) and value.kind == "null":
        raise refuse("HS121", f"{kind} is missing here", kind)
    return _single(value, "an expression")


def _condition(value: Any) -> Scalar:
    if isinstance(value, list):
        parts = [part.value for part in value if isinstance(part, Scalar)]  # pyright: ignore[reportUnknownVariableType]
        hint = in_brackets(value) or f"join conditions: {shown(' and '.join(parts))}"
        raise refuse("HS203", "a condition is wanted here, not a list", hint)
    return _expression(value, "a condition, such as v > 0")


def _inequality(value: Any) -> Scalar:
    if isinstance(value, list):
        hint = in_brackets(value) or "under `when`, put the rest under `if`; under `domain`, make each an item"
        raise refuse("HS203", "one inequality is wanted here, not a list", hint)
    return _expression(value, "an inequality, such as x >= 1")


def _text(value: Any) -> Scalar | None:
    scalar = _single(value, "a text")
    return None if scalar.kind == "null" else scalar


def _label(value: Any) -> Scalar:
    scalar = _single(value, "a name")
    if not scalar.value.strip():
        raise refuse("HS205", "a name is missing here")
    return scalar


def _flag(value: Any) -> bool:
    scalar = _single(value, "true or false")
    if scalar.kind != "boolean":
        words = {"yes": "true", "on": "true", "y": "true", "no": "false", "off": "false", "n": "false"}
        hint = words.get(scalar.value.lower())
        raise refuse(
            "HS204", f"true or false is wanted here, not {described(scalar)}", f"write {hint}" if hint else None
        )
    return scalar.value.lower() == "true"


def _whole(value: Any) -> int:
    scalar = _single(value, "a whole number")
    digits = scalar.value[1:] if scalar.value[:1] in "+-" else scalar.value
    if not (scalar.kind == "number" and digits.isdigit() and len(digits) <= 9):
        raise refuse("HS204", f"a whole number is wanted here, not {described(scalar)}", "such as 1 or -2")
    return int(scalar.value)


def choice(*words: str) -> Callable[[Any], Scalar]:
    """A validator for one of some words."""

    def check(value: Any) -> Scalar:
        scalar = _single(value, " or ".join(words))
        if scalar.value not in words:
            hint = did_you_mean(scalar.value, words)
            raise refuse("HS204", f"{' or '.join(words)} is wanted here, not {described(scalar)}", hint)
        return scalar

    return check


def _identifier(value: Any) -> Scalar:
    scalar = _single(value, "a word")
    if not is_identifier(scalar.value):
        raise refuse("HS204", f"a word is wanted here, not {described(scalar)}")
    return scalar


def _version(value: Any) -> Scalar:
    scalar = _single(value, "the version of the language")
    if scalar.value != "1":
        raise refuse("HS206", f"{described(scalar)} is not a known version of the language", "write hsdsl: 1")
    return scalar


def _name(key: Any) -> Key:
    if not is_identifier(key):
        message = f"'{shown(key)}' cannot be a name"
        raise refuse("HS205", message, as_name(key))
    if key in RESERVED:
        kind = "a word of the language" if key in WORDS else "a function"
        kind = {"t": "the time", "pi": "a constant"}.get(key, kind)
        raise refuse("HS205", f"'{key}' is {kind} and cannot be a name", "choose another name")
    return key


def _state_name(key: Any) -> Key:
    if key == "mode":
        raise refuse("HS205", "a state cannot be called 'mode', which `initial` uses", "choose another name")
    return _name(key)


def _mode_name(key: Any) -> Key:
    if not key or any(c.isspace() for c in key):
        raise refuse("HS205", f"'{shown(key)}' cannot be the name of a mode", "a mode's name has no blanks")
    return key


def _any_key(key: Any) -> Key:
    if assigned(key):
        raise refuse("HS205", f"'{shown(key)}' is not a name", as_name(key))
    return key


def _empty(value: Any) -> bool:
    return isinstance(value, Scalar) and (value.kind == "null" or value.value == ABSENT)


def shaped_as_mapping(value: Any) -> Any:
    """A mapping; what is left empty is an empty one."""
    if _empty(value):
        return {}
    if not isinstance(value, dict):
        raise refuse("HS203", f"a mapping (name: value) is wanted here, not {described(value)}", as_mapping(value))
    return value  # pyright: ignore[reportUnknownVariableType]


def shaped_as_list(value: Any) -> Any:
    """A list; what is left empty is an empty one."""
    if _empty(value):
        return []
    if not isinstance(value, list):
        raise refuse("HS203", f"a list is wanted here, not {described(value)}", as_list(value))
    return value  # pyright: ignore[reportUnknownVariableType]


def required(description: str, *examples: Any) -> Any:
    """A key that must be there."""
    return Field(description=description, examples=list(examples))


def optional(description: str, *examples: Any, default: Any = None, alias: str | None = None) -> Any:
    """A key with a default."""
    return Field(default, description=description, examples=list(examples), alias=alias)


def mapping(description: str, *examples: Any, alias: str | None = None) -> Any:
    """A key whose mapping is empty where it is left out."""
    return Field(default_factory=dict[Any, Any], description=description, examples=list(examples), alias=alias)


def items(description: str, *examples: Any) -> Any:
    """A key whose list is empty where it is left out."""
    return Field(default_factory=list[Any], description=description, examples=list(examples))


class Document(BaseModel):
    """A mapping with known keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)

    @model_validator(mode="before")
    @classmethod
    def _shape(cls, value: Any) -> Any:
        return shaped_as_mapping(value)


_NUMBER_OR_TEXT: dict[str, Any] = {"type": ["number", "string"]}
_ANY_SCALAR: dict[str, Any] = {"type": ["string", "number", "boolean", "null"]}

Expression = Annotated[Scalar, PlainValidator(_expression), WithJsonSchema(_NUMBER_OR_TEXT)]
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
Word = Annotated[Scalar | None, PlainValidator(_identifier), WithJsonSchema({"type": "string"})]
Version = Annotated[Scalar, PlainValidator(_version), WithJsonSchema({"const": 1})]
Scheme = Annotated[
    Scalar | None,
    PlainValidator(choice("relaxed", "located", "paoli-schatzman")),
    WithJsonSchema({"type": "string", "enum": ["relaxed", "located", "paoli-schatzman"]}),
]
Hold = Annotated[
    Literal["zero", "linear"],
    PlainValidator(lambda value: choice("zero", "linear")(value).value),
    WithJsonSchema({"type": "string", "enum": ["zero", "linear"]}),
]

Name = Annotated[Key, PlainValidator(_name), WithJsonSchema({"type": "string"})]
StateName = Annotated[Key, PlainValidator(_state_name), WithJsonSchema({"type": "string"})]
ModeName = Annotated[Key, PlainValidator(_mode_name), WithJsonSchema({"type": "string"})]
AnyKey = Annotated[Key, PlainValidator(_any_key), WithJsonSchema({"type": "string"})]

Table = Annotated[dict[Name, T], BeforeValidator(shaped_as_mapping)]
StateTable = Annotated[dict[StateName, T], BeforeValidator(shaped_as_mapping)]
ModeTable = Annotated[dict[ModeName, T], BeforeValidator(shaped_as_mapping)]
OpenTable = Annotated[dict[AnyKey, T], BeforeValidator(shaped_as_mapping)]
Items = Annotated[list[T], BeforeValidator(shaped_as_list)]
