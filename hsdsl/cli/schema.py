"""``hsdsl schema``: the JSON Schema of model files, for editors."""


def schema() -> None:
    """Print the JSON Schema of the language (draft 7)."""
    import json

    from hsdsl.schema import json_schema

    print(json.dumps(json_schema(), indent=2))
