"""The shape of a model file: pydantic documents, their faults in the language's own words, and the JSON Schema."""

from hsdsl.schema.documents import Experiment, Mode, Model, ParameterEntry, Reference, ReferenceTransition, Transition
from hsdsl.schema.inputs import InputFile, InputSamples
from hsdsl.schema.jsonschema import json_schema
from hsdsl.schema.read import read

__all__ = [
    "Experiment",
    "InputFile",
    "InputSamples",
    "Mode",
    "Model",
    "ParameterEntry",
    "Reference",
    "ReferenceTransition",
    "Transition",
    "json_schema",
    "read",
]
