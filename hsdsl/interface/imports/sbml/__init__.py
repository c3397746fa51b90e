"""Models of SBML, Levels 2 and 3, as models of this language; what the language has no words for is refused.

=============  =====================================================================
`document`     the lists of a file, with the defaults of their level
`mathml`       its formulas as trees
`formulas`     formulas as text of the language
`facts`        what is a state, a parameter, or given by a rule
`convert`      the document of a model
`writing`      its text, and units
=============  =====================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hsdsl.base.errors import ModelError, UsageError
from hsdsl.base.names import shown
from hsdsl.interface.imports.sbml.convert import Converter
from hsdsl.interface.imports.sbml.document import is_sbml, model_of
from hsdsl.interface.imports.sbml.mathml import NotExpressible
from hsdsl.interface.imports.sbml.writing import written
from hsdsl.language.expression.parse import ExpressionError
from hsdsl.language.expression.plain import value
from hsdsl.language.expression.timebox import deep_stack
from hsdsl.language.source.xml import Element, read_xml

__all__ = ["DEEPEST", "FEATURE", "converted", "imported", "is_sbml"]

_HINTS = {"the package 'comp'": "have its submodels written out, by COPASI or libSBML"}
FEATURE = "HS334"  # the code of what a model cannot keep


DEEPEST = 256  # elements of a file in each other


def imported(root: Element, until: str | None = None) -> str:
    """The text of a model for the root of a file.

    Parameters
    ----------
    root : Element
        Of an SBML file, Level 2 or 3.
    until : str
        The end of the run, which SBML does not say.

    Raises ModelError: what a model cannot keep, with its place.
    Raises UsageError: no end of the run.
    """
    if not until:
        raise UsageError("the end of the run is not given", "SBML does not say it: give --until")
    try:
        if not bool(value(until) >= 0):
            raise UsageError(f"the end of the run must not be negative, got {shown(until, 40)}")
    except (ExpressionError, TypeError) as error:
        raise UsageError(f"the end of the run: expected a number, got '{shown(until, 40)}'") from error
    converter = _converter(root)
    return written(converter, _document(converter, {}, until), root.file.path)


def converted(path: str, data: bytes, outputs: Mapping[str, str], until: str) -> dict[str, Any]:
    """The document of a file with what is recorded: names, each with ``value``, ``amount`` or ``concentration``.

    Raises ModelError: what a model cannot keep, with its place.
    """
    return _document(_converter(read_xml(path, data, DEEPEST)), outputs, until)


def _converter(root: Element) -> Converter:
    try:
        with deep_stack():
            return Converter(model_of(root))
    except NotExpressible as feature:
        raise _refused(feature, root) from None


def _document(converter: Converter, outputs: Mapping[str, str], until: str) -> dict[str, Any]:
    try:
        with deep_stack():
            return converter.document(outputs, until)
    except NotExpressible as feature:
        raise _refused(feature, converter.model.element) from None


def _refused(feature: NotExpressible, element: Element) -> ModelError:
    place = feature.element or element
    return ModelError([place.fault(FEATURE, f"a model cannot have {feature}", _HINTS.get(str(feature)))])
