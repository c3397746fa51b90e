"""The shape of a model file: pydantic documents, their faults in the language's own words, and the JSON Schema.

`documents` has the keys of each mapping (`shapes` those of a scene), `fields` the values that each may hold, and
`jsonschema` is made of both. `read` makes documents of nodes: it explains faults by `suggestions`, `value_suggestions`,
`indentation`, `idioms` and `spelling`, and reads on without them (`recovery`).
"""

from hsdsl.language.schema.documents import (
    AutomatonDocument,
    AutomatonFile,
    ExperimentDocument,
    FunctionDocument,
    InitialDocument,
    InputFile,
    InputSamples,
    InstanceDocument,
    ModeDocument,
    ModelDocument,
    MultiplesDocument,
    ParameterEntry,
    PartInitialDocument,
    PartModeDocument,
    PartTransitionDocument,
    ReferenceDocument,
    ReferenceStateDocument,
    ReferenceTransitionDocument,
    SolveDocument,
    SystemDocument,
    TransitionDocument,
)
from hsdsl.language.schema.jsonschema import json_schema
from hsdsl.language.schema.read import read

__all__ = [
    "AutomatonDocument", "AutomatonFile", "ExperimentDocument", "FunctionDocument", "InitialDocument", "InputFile",
    "InputSamples", "InstanceDocument", "ModeDocument", "ModelDocument", "MultiplesDocument", "ParameterEntry",
    "PartInitialDocument", "PartModeDocument", "PartTransitionDocument", "ReferenceDocument", "ReferenceStateDocument",
    "ReferenceTransitionDocument", "SolveDocument", "SystemDocument", "TransitionDocument", "json_schema", "read",
]  # fmt: skip
