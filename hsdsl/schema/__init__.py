"""The shape of a model file: pydantic documents, their faults in the language's own words, and the JSON Schema."""

from hsdsl.schema.documents import (
    ExperimentDocument,
    FunctionDocument,
    InputFile,
    InputSamples,
    ModeDocument,
    ModelDocument,
    ParameterEntry,
    ReferenceDocument,
    ReferenceStateDocument,
    ReferenceTransitionDocument,
    TransitionDocument,
)
from hsdsl.schema.jsonschema import json_schema
from hsdsl.schema.read import read

__all__ = [
    "ExperimentDocument",
    "FunctionDocument",
    "InputFile",
    "InputSamples",
    "ModeDocument",
    "ModelDocument",
    "ParameterEntry",
    "ReferenceDocument",
    "ReferenceStateDocument",
    "ReferenceTransitionDocument",
    "TransitionDocument",
    "json_schema",
    "read",
]
