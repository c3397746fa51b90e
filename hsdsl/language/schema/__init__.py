"""The shape of a model file: what may stand where.

`documents` has the keys of each mapping, `fields` the values that each may hold, and `jsonschema` is made of both.
:func:`read` makes documents of nodes.
"""

from __future__ import annotations

from pydantic import ValidationError

from hsdsl.base.errors import Findings
from hsdsl.language.schema.documents import ModelDocument, SystemDocument, plain
from hsdsl.language.source.nodes import Node, keys


def read(root: Node, findings: Findings) -> ModelDocument:
    """The document of a YAML file; of one with faults, which go to ``findings``, what can still be read.

    Raises ModelError: when too little is left to be called a model.
    """
    kind = SystemDocument if {"system", "automata"} & set(map(str, keys(root))) else ModelDocument
    try:
        return kind.model_validate(plain(root))
    except ValidationError:
        from hsdsl.language.diagnosis.documents import recovered

        return recovered(root, findings, kind)
