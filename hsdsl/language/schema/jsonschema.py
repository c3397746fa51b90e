"""The JSON Schema of model files, for editors: draft 7, with a description on every key."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from hsdsl.language.schema.documents import SystemDocument

_DRAFT = "http://json-schema.org/draft-07/schema#"


class _Generator(GenerateJsonSchema):
    """With a description and examples of each key, and without the titles that pydantic makes out of names."""

    def model_schema(self, schema: Any) -> dict[str, Any]:
        """The schema of a class; a key that the class has from another means the same."""
        made = super().model_schema(schema)
        of_kinds = [_keys().get(_short(kind.__name__), {}) for kind in schema["cls"].__mro__]
        for name, field in schema["cls"].model_fields.items():
            about, *examples = next(keys[name] for keys in of_kinds if name in keys)
            made["properties"][field.alias or name] |= {"description": about, "examples": examples}
        return made

    def field_title_should_be_set(self, schema: Any) -> bool:
        """Never."""
        return False


def json_schema() -> dict[str, Any]:
    """The JSON Schema of a model file, draft 7: shared parts are under ``definitions``, and a ``$ref`` is alone."""
    made = SystemDocument.model_json_schema(
        by_alias=True, ref_template="#/definitions/{model}", schema_generator=_Generator
    )
    definitions = {_short(name): _draft_7(part) for name, part in sorted(made.pop("$defs").items())}
    transition = definitions["Transition"]
    transition["anyOf"] = [{"required": transition.pop("required")}, {"required": ["event"]}]
    root = _draft_7(made)
    reference = root["properties"]["reference"]
    item = reference.pop("items")
    root["properties"]["reference"] = {
        "description": reference.pop("description"),
        "examples": reference.pop("examples"),
        "anyOf": [item, {"type": ["array", "null"], "items": item}],
    }
    root["anyOf"] = [{"required": ["modes", "initial"]}, {"required": ["automata", "system"]}]
    return {"$schema": _DRAFT, **root, "definitions": definitions}


@cache
def _keys() -> dict[str, Any]:
    return tomllib.loads(Path(__file__).with_name("keys.toml").read_text(encoding="utf-8"))


def _short(name: str) -> str:
    """The name of a definition: that of its class without its ending."""
    return name.removesuffix("Document")


def _draft_7(part: Any) -> Any:
    """A part with what may be left empty allowed to be null, and siblings of ``$ref`` moved next to an ``allOf``."""
    if isinstance(part, list):
        return [_draft_7(item) for item in part]  # pyright: ignore[reportUnknownVariableType]
    if not isinstance(part, dict):
        return part
    made: dict[str, Any] = {key: _draft_7(value) for key, value in part.items()}  # pyright: ignore[reportUnknownVariableType]
    if made.get("type") in ("object", "array"):
        made["type"] = [made["type"], "null"]
    if made.get("default", ...) is None:
        del made["default"]
    made.pop("propertyNames", None)
    for key in ("title", "$ref"):
        if isinstance(made.get(key), str):
            made[key] = _short(made[key])
    if "$ref" in made and len(made) > 1:
        made["allOf"] = [{"$ref": made.pop("$ref")}]
    return made
