"""``hsdsl schema``: the JSON Schema of model files, for editors."""

from __future__ import annotations

from hsdsl.interface.cli.options import Json


def schema(json: Json = False) -> None:
    """Print the JSON Schema of the language (draft 7), which is one JSON object as it is."""
    from json import dumps

    from hsdsl.language.schema.jsonschema import json_schema

    print(dumps(json_schema(), indent=2))
