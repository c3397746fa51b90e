# pyright: basic
"""Submodels of SBML (the package `comp`) written out by libSBML's own converter, which people install for that."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hsdsl.base.errors import ModelError
from hsdsl.interface.imports.sbml.document import NotExpressible
from hsdsl.language.source.xml import Element, read_xml

COMP = "comp:required"
HINT = "pip install 'hsdsl[sbml]': libSBML writes its submodels out"


def flattened(root: Element, deepest: int) -> Element:
    """The root of a file without submodels; places are those in the text that libSBML makes of it.

    Raises NotExpressible: libSBML is not there. Raises ModelError: it cannot write them out.
    """
    if root.attributes.get(COMP) != "true":
        return root
    try:
        import libsbml  # pyright: ignore[reportMissingImports]
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
        raise ModelError([root.fault("HS334", message)])
    return read_xml(f"{path} (submodels written out)", libsbml.writeSBMLToString(document).encode(), deepest)
