"""Functional mock-up units of FMI 2.0 and 3.0, for model exchange and co-simulation.

Both versions share `variables`, their C, most of their `description`, and the `archive`.
"""

from __future__ import annotations

from functools import partial

from hsdsl.export import Modes
from hsdsl.export.fmi import description as xml
from hsdsl.export.fmi.archive import compiled_names, unit_file
from hsdsl.export.fmi.variables import Unit, unit_of
from hsdsl.export.source import Source

_CAN2 = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True, "providesDirectionalDerivative": True}
_CAN3 = {
    **{"canGetAndSetFMUState": True, "canSerializeFMUState": True},
    **{"providesDirectionalDerivatives": True, "providesAdjointDerivatives": True},
}


def _files(version: int, source: Source, modes: Modes = "local") -> dict[str, bytes]:
    """One ``.fmu`` file; ``modes`` says what the numbers of modes are to the caller.

    Raises UsageError: the C runtime has no such scheme, or there is no compiler.
    """
    unit = unit_of(source, modes)
    if version == 2:
        return unit_file(unit, 2, description2(unit), {})
    return unit_file(unit, 3, description3(unit), {"sources/buildDescription.xml": build_description(unit).encode()})


files2, files3 = partial(_files, 2), partial(_files, 3)


def description2(unit: Unit) -> str:
    """The text of ``modelDescription.xml`` of FMI 2.0."""
    listed = [(i, variable) for i, variable in enumerate(unit.variables) if variable.kind != "indicator"]
    units = {i: None if v.kind == "time" else xml.unit_of_measure(unit, v) for i, v in listed}
    root = xml.root_of(unit, 2, numberOfEventIndicators=str(len(unit.references("indicator"))))
    for tag, further in (
        ("ModelExchange", {"completedIntegratorStepNotNeeded": True}),
        ("CoSimulation", {"canHandleVariableCommunicationStepSize": True}),
    ):
        kind = xml.element(root, tag, modelIdentifier=unit.source.name, **further, **_CAN2)
        files = xml.element(kind, "SourceFiles")
        for file in compiled_names(2):
            xml.element(files, "File", name=file)
    xml.define_units(root, units.values())
    xml.define_experiment(root, unit, ("logStatusError",))
    variables = xml.element(root, "ModelVariables")
    for reference, variable in listed:
        scalar = xml.element(variables, "ScalarVariable", **xml.named(unit, variable, reference))
        if variable.kind == "mode":
            xml.element(scalar, "Integer")
        else:
            xml.element(scalar, "Real", unit=units[reference], **xml.numbers(unit, variable, 1))
    lists = {
        "Outputs": (xml.outputs(unit), "Unknown"),
        "Derivatives": (unit.references("derivative"), "Unknown"),
        "InitialUnknowns": (xml.initial_unknowns(unit), "Unknown"),
    }
    xml.structure(root, unit, lists, "index", 1)
    return xml.written(root)


def build_description(unit: Unit) -> str:
    """The text of ``buildDescription.xml``."""
    root = xml.element(None, "fmiBuildDescription", fmiVersion="3.0")
    build = xml.element(root, "BuildConfiguration", modelIdentifier=unit.source.name)
    names = xml.element(build, "SourceFileSet", language="C99", compiler="gcc", compilerOptions="-ffp-contract=off")
    for name in compiled_names(3):
        xml.element(names, "SourceFile", name=name)
    return xml.written(root)


def description3(unit: Unit) -> str:
    """The text of ``modelDescription.xml`` of FMI 3.0."""
    name, root = unit.source.name, xml.root_of(unit, 3)
    xml.element(root, "ModelExchange", modelIdentifier=name, needsCompletedIntegratorStep=False, **_CAN3)
    steps = {"canHandleVariableCommunicationStepSize": True, "hasEventMode": True}
    xml.element(root, "CoSimulation", modelIdentifier=name, **steps, **_CAN3)
    xml.define_units(root, [xml.unit_of_measure(unit, variable) for variable in unit.variables])
    xml.define_experiment(root, unit, ("logStatusError", "logEvents"))
    variables = xml.element(root, "ModelVariables")
    for reference, variable in enumerate(unit.variables):
        known = xml.named(unit, variable, reference)
        if variable.kind == "mode":
            xml.element(variables, "Int32", **known)
        else:
            known |= {"unit": xml.unit_of_measure(unit, variable)} | xml.numbers(unit, variable, 0)
            xml.element(variables, "Float64", **known)
    lists = {
        "Output": xml.outputs(unit),
        "ContinuousStateDerivative": unit.references("derivative"),
        "InitialUnknown": xml.initial_unknowns(unit),
        "EventIndicator": unit.references("indicator"),
    }
    xml.structure(root, unit, {tag: (unknowns, tag) for tag, unknowns in lists.items()}, "valueReference", 0)
    return xml.written(root)
