"""A functional mock-up unit of FMI 2.0, for model exchange and co-simulation."""

from __future__ import annotations

from hsdsl.export import Modes
from hsdsl.export.fmi import description as xml
from hsdsl.export.fmi.archive import compiled_names, unit_file
from hsdsl.export.fmi.variables import Unit, Variable, unit_of
from hsdsl.export.source import Source

_CAN = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True, "providesDirectionalDerivative": True}


def files(source: Source, modes: Modes = "local") -> dict[str, bytes]:
    """One ``.fmu`` file; ``modes`` says what the numbers of modes are to the caller.

    Raises UsageError: the C runtime has no such scheme, or there is no compiler.
    """
    unit = unit_of(source, modes)
    return unit_file(unit, 2, description(unit), {})


def description(unit: Unit) -> str:
    """The text of ``modelDescription.xml``."""
    listed = [(i, variable) for i, variable in enumerate(unit.variables) if variable.kind != "indicator"]
    root = xml.root_of(unit, 2, numberOfEventIndicators=str(len(unit.references("indicator"))))
    for tag, further in (
        ("ModelExchange", {"completedIntegratorStepNotNeeded": True}),
        ("CoSimulation", {"canHandleVariableCommunicationStepSize": True}),
    ):
        kind = xml.element(root, tag, modelIdentifier=unit.source.name, **further, **_CAN)
        files = xml.element(kind, "SourceFiles")
        for file in compiled_names(2):
            xml.element(files, "File", name=file)
    xml.define_units(root, [_unit(unit, variable) for _, variable in listed])
    xml.define_experiment(root, unit, ("logStatusError",))
    variables = xml.element(root, "ModelVariables")
    for reference, variable in listed:
        scalar = xml.element(variables, "ScalarVariable", **xml.named(unit, variable, reference))
        if variable.kind == "mode":
            xml.element(scalar, "Integer")
        else:
            xml.element(scalar, "Real", unit=_unit(unit, variable), **xml.numbers(unit, variable, 1))
    lists = {
        "Outputs": (xml.outputs(unit), "Unknown"),
        "Derivatives": (unit.references("derivative"), "Unknown"),
        "InitialUnknowns": (xml.initial_unknowns(unit), "Unknown"),
    }
    xml.structure(root, unit, lists, "index", 1)
    return xml.written(root)


def _unit(unit: Unit, variable: Variable) -> str | None:
    return None if variable.kind == "time" else xml.unit_of_measure(unit, variable)
