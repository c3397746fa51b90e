"""A functional mock-up unit of FMI 2.0, for model exchange and co-simulation."""

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
    root = root_of(unit, 2, numberOfEventIndicators=str(len(unit.references("indicator"))))
    for tag, further in (
        ("ModelExchange", {"completedIntegratorStepNotNeeded": True}),
        ("CoSimulation", {"canHandleVariableCommunicationStepSize": True}),
    ):
        kind = element(root, tag, modelIdentifier=unit.source.name, **further, **_CAN)
        files = element(kind, "SourceFiles")
        for file in compiled_names(2):
            element(files, "File", name=file)
    define_units(root, [_unit(unit, variable) for _, variable in listed])
    define_experiment(root, unit, ("logStatusError",))
    variables = element(root, "ModelVariables")
    for reference, variable in listed:
        scalar = element(variables, "ScalarVariable", **named(unit, variable, reference))
        if variable.kind == "mode":
            element(scalar, "Integer")
        else:
            element(scalar, "Real", unit=_unit(unit, variable), **numbers(unit, variable, 1))
    lists = {
        "Outputs": (outputs(unit), "Unknown"),
        "Derivatives": (unit.references("derivative"), "Unknown"),
        "InitialUnknowns": (initial_unknowns(unit), "Unknown"),
    }
    structure(root, unit, lists, "index", 1)
    return written(root)


def _unit(unit: Unit, variable: Variable) -> str | None:
    return None if variable.kind == "time" else unit_of_measure(unit, variable)
