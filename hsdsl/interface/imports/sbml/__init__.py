"""Models of SBML, Levels 2 and 3, as models of this language; what the language has no words for is refused.

`document` has the lists of a file with the defaults of their level, and its formulas as trees; `formulas` formulas as
text of the language, and what each quantity is; `order` what draws the order of events of equal priority; `convert` the
document of a model, `text` its text. Submodels (the package `comp`) are written out by libSBML's own converter, which
people install for that.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from hsdsl.base.errors import Diagnostic, ModelError, UsageError
from hsdsl.interface.imports import end_of_run
from hsdsl.interface.imports.sbml.convert import Converter
from hsdsl.interface.imports.sbml.document import NotExpressible, is_sbml, model_of
from hsdsl.interface.imports.sbml.order import MODULUS
from hsdsl.interface.imports.sbml.text import written
from hsdsl.language.expression.timebox import deep_stack
from hsdsl.language.source.xml import Element, read_xml

__all__ = ["DEEPEST", "FEATURE", "imported", "is_sbml", "placed"]

_HINTS = {"the package 'comp'": "pip install 'hsdsl[sbml]': libSBML writes its submodels out"}
FEATURE = "HS334"  # the code of what a model cannot keep
DEEPEST = 256  # elements of a file in each other
_KEY = re.compile(r"( *(?:- )?)\"?([A-Za-z_]\w*)\"?:(?: ([A-Za-z_]\w*)$)?")
_FIRST = {
    **dict.fromkeys(("let", "outputs"), "assignmentRule"),
    **dict.fromkeys(("initial", "parameters"), "initialAssignment"),
    "flow": "rateRule",
}


def imported(root: Element, until: str | None = None, outputs: Mapping[str, str] | None = None, seed: int = 1) -> str:
    """The text of a model for the root of an SBML file, Level 2 or 3.

    The file does not say when a run ends, at ``until``. ``outputs`` are what is recorded: names, each with ``value``,
    ``amount`` or ``concentration``. ``seed`` draws the order of simultaneous events of equal priority.

    Raises ModelError: what a model cannot keep, with its place.
    Raises UsageError: no end of the run; a seed that is too small or too large.
    """
    end = end_of_run(until, "SBML does not say it: give --until")
    if not 0 < seed < MODULUS:
        raise UsageError(f"--seed: expected a whole number from 1 to {MODULUS - 1}, got {seed}")
    try:
        with deep_stack():
            root = _flattened(root)
            converter = Converter(model_of(root), seed)
            return written(converter, converter.document(outputs or {}, end), root.file.path)
    except NotExpressible as feature:
        place = feature.element or root
        raise place.refusal(FEATURE, feature.message, _HINTS.get(str(feature))) from None


def _flattened(root: Element) -> Element:
    """The root of a file without submodels; places are those in the text that libSBML makes of it.

    Raises NotExpressible: libSBML is not there. Raises ModelError: it cannot write them out.
    """
    if root.attributes.get("comp:required") != "true":
        return root
    try:
        libsbml: Any = import_module("libsbml")
    except ImportError:
        raise NotExpressible("the package 'comp'", root) from None
    path = Path(root.file.path)
    document: Any = libsbml.readSBMLFromString(root.file.content)
    options: Any = libsbml.ConversionProperties()
    for name, value in {"flatten comp": True, "performValidation": False, "leavePorts": False}.items():
        options.addOption(name, value)
    options.addOption("basePath", str(path.parent))
    if document.convert(options) != libsbml.LIBSBML_OPERATION_SUCCESS:
        said = document.getErrorLog().toString().strip().splitlines()
        message = f"libSBML cannot write the submodels out: {said[-1] if said else 'it does not say why'}"
        raise root.refusal(FEATURE, message)
    return read_xml(f"{path} (submodels written out)", libsbml.writeSBMLToString(document).encode(), DEEPEST)


def placed(error: ModelError, text: str, root: Element) -> ModelError:
    """The error with the elements that its lines in a model's text come from."""
    elements = list(root.within())
    return ModelError([_placed(diagnostic, text.splitlines(), elements) for diagnostic in error.diagnostics])


def _placed(diagnostic: Diagnostic, lines: list[str], elements: list[Element]) -> Diagnostic:
    keys = [] if diagnostic.span is None else list(_above(lines, diagnostic.span.line - 1))
    names = [name for name in keys for name in (name, name.rstrip("_"), name.removeprefix("amount_of_"))]
    sections = [_FIRST[key] for key in keys if key in _FIRST]
    for name in names:
        own = [one for one in elements if name in map(one.attributes.get, ("id", "variable", "symbol"))]
        own.sort(key=lambda one: (one.tag not in sections, "id" not in one.attributes))
        if own:
            place = own[0].fault(diagnostic.code, f"{name}: {diagnostic.message}", diagnostic.hint)
            return replace(diagnostic, message=place.message, span=place.span, text=place.text, fix=())
    place = elements[0].fault(diagnostic.code, diagnostic.message)
    return replace(diagnostic, span=place.span, text=place.text, fix=())


def _above(lines: list[str], at: int) -> Iterator[str]:
    """The keys that a line is under, the innermost first; of an item of a list, its name."""
    depth = 10**6
    for line in reversed(lines[: at + 1]):
        found = _KEY.match(line)
        if not found:
            continue
        if found[2] == "name" and found[3] and len(found[1]) <= depth:
            yield found[3]
        if len(found[1]) < depth:
            depth = len(found[1])
            yield found[2]
