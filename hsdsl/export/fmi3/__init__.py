"""A functional mock-up unit of FMI 3.0, for model exchange and co-simulation."""

from __future__ import annotations

from hsdsl.export import Modes
from hsdsl.export.fmi import description as xml
from hsdsl.export.fmi.archive import compiled_names, unit_file
from hsdsl.export.fmi.variables import Unit, unit_of
from hsdsl.export.source import Source

_CAN = {
    "canGetAndSetFMUState": True,
    "canSerializeFMUState": True,
    "providesDirectionalDerivatives": True,
    "providesAdjointDerivatives": True,
}


def files(source: Source, modes: Modes = "local") -> dict[str, bytes]:
    """One ``.fmu`` file; ``modes`` says what the numbers of modes are to the caller.

    Raises UsageError: the C runtime has no such scheme, or there is no compiler.
    """
    unit = unit_of(source, modes)
    build = {"sources/buildDescription.xml": build_description(unit).encode()}
    return unit_file(unit, 3, description(unit), build)


def build_description(unit: Unit) -> str:
    """The text of ``buildDescription.xml``."""
    root = xml.element(None, "fmiBuildDescription", fmiVersion="3.0")
    build = xml.element(root, "BuildConfiguration", modelIdentifier=unit.source.name)
    names = xml.element(build, "SourceFileSet", language="C99", compiler="gcc", compilerOptions="-ffp-contract=off")
    for name in compiled_names(3):
        xml.element(names, "SourceFile", name=name)
    return xml.written(root)


def description(unit: Unit) -> str:
    """The text of ``modelDescription.xml``."""
    name, root = unit.source.name, xml.root_of(unit, 3)
    xml.element(root, "ModelExchange", modelIdentifier=name, needsCompletedIntegratorStep=False, **_CAN)
    steps = {"canHandleVariableCommunicationStepSize": True, "hasEventMode": True}
    xml.element(root, "CoSimulation", modelIdentifier=name, **steps, **_CAN)
    xml.define_units(root, [xml.unit_of_measure(unit, variable) for variable in unit.variables])
    xml.define_experiment(root, unit, ("logStatusError", "logEvents"))
    variables = xml.element(root, "ModelVariables")
    for reference, variable in enumerate(unit.variables):
        known = xml.named(unit, variable, reference)
        if variable.kind == "mode":
            xml.element(variables, "Int32", **known)
        else:
            xml.element(
                variables,
                "Float64",
                **known,
                unit=xml.unit_of_measure(unit, variable),
                **xml.numbers(unit, variable, 0),
            )
    lists = {
        "Output": xml.outputs(unit),
        "ContinuousStateDerivative": unit.references("derivative"),
        "InitialUnknown": xml.initial_unknowns(unit),
        "EventIndicator": unit.references("indicator"),
    }
    xml.structure(root, unit, {tag: (unknowns, tag) for tag, unknowns in lists.items()}, "valueReference", 0)
    return xml.written(root)
