"""Models of SBML, Levels 2 and 3, as models of this language; what the language has no words for is refused.

`document` has the lists of a file with the defaults of their level, and its formulas as trees; `formulas` formulas as
text of the language, and what each quantity is; `convert` the document of a model, `text` its text; `places` of faults
in it; `submodels` writes those of the package `comp` out.
"""

from __future__ import annotations

from collections.abc import Mapping

from hsdsl.base.errors import ModelError
from hsdsl.interface.imports import end_of_run
from hsdsl.interface.imports.sbml.convert import Converter
from hsdsl.interface.imports.sbml.document import NotExpressible, is_sbml, model_of
from hsdsl.interface.imports.sbml.places import placed
from hsdsl.interface.imports.sbml.submodels import HINT, flattened
from hsdsl.interface.imports.sbml.text import written
from hsdsl.language.expression.timebox import deep_stack
from hsdsl.language.source.xml import Element

__all__ = ["DEEPEST", "FEATURE", "imported", "is_sbml", "placed"]

_HINTS = {"the package 'comp'": HINT}
FEATURE = "HS334"  # the code of what a model cannot keep
DEEPEST = 256  # elements of a file in each other


def imported(root: Element, until: str | None = None, outputs: Mapping[str, str] | None = None) -> str:
    """The text of a model for the root of an SBML file, Level 2 or 3.

    The file does not say when a run ends, at ``until``. ``outputs`` are what is recorded: names, each with ``value``,
    ``amount`` or ``concentration``.

    Raises ModelError: what a model cannot keep, with its place.
    Raises UsageError: no end of the run.
    """
    end = end_of_run(until, "SBML does not say it: give --until")
    try:
        with deep_stack():
            root = flattened(root, DEEPEST)
            converter = Converter(model_of(root))
            return written(converter, converter.document(outputs or {}, end), root.file.path)
    except NotExpressible as feature:
        place = feature.element or root
        raise ModelError([place.fault(FEATURE, feature.message, _HINTS.get(str(feature)))]) from None
