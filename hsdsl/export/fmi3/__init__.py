"""A functional mock-up unit of FMI 3.0, for model exchange and co-simulation."""

from __future__ import annotations

from hsdsl.export import Modes
from hsdsl.export.fmi.archive import compiled_names, unit_file
from hsdsl.export.fmi.description import (
    define_experiment,
    define_units,
    element,
    initial_unknowns,
    named,
    numbers,
    outputs,
    root_of,
    structure,
    unit_of_measure,
    written,
)
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
    root = element(None, "fmiBuildDescription", fmiVersion="3.0")
    build = element(root, "BuildConfiguration", modelIdentifier=unit.source.name)
    names = element(build, "SourceFileSet", language="C99", compiler="gcc", compilerOptions="-ffp-contract=off")
    for name in compiled_names(3):
        element(names, "SourceFile", name=name)
    return written(root)


def description(unit: Unit) -> str:
    """The text of ``modelDescription.xml``."""
    name, root = unit.source.name, root_of(unit, 3)
    element(root, "ModelExchange", modelIdentifier=name, needsCompletedIntegratorStep=False, **_CAN)
    steps = {"canHandleVariableCommunicationStepSize": True, "hasEventMode": True}
    element(root, "CoSimulation", modelIdentifier=name, **steps, **_CAN)
    define_units(root, [unit_of_measure(unit, variable) for variable in unit.variables])
    define_experiment(root, unit, ("logStatusError", "logEvents"))
    variables = element(root, "ModelVariables")
    for reference, variable in enumerate(unit.variables):
        known = named(unit, variable, reference)
        if variable.kind == "mode":
            element(variables, "Int32", **known)
        else:
            element(variables, "Float64", **known, unit=unit_of_measure(unit, variable), **numbers(unit, variable, 0))
    lists = {
        "Output": outputs(unit),
        "ContinuousStateDerivative": unit.references("derivative"),
        "InitialUnknown": initial_unknowns(unit),
        "EventIndicator": unit.references("indicator"),
    }
    structure(root, unit, {tag: (unknowns, tag) for tag, unknowns in lists.items()}, "valueReference", 0)
    return written(root)
