"""A functional mock-up unit of FMI 2.0, for model exchange and co-simulation."""

from __future__ import annotations

from hsdsl import __version__
from hsdsl.export.fmi.archive import compiled_names, token_of, unit_file
from hsdsl.export.fmi.variables import Unit, Variable, unit_of
from hsdsl.export.fmi.xml import Element, define_units, element, per_time, written
from hsdsl.export.source import Source

_CAN = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True, "providesDirectionalDerivative": True}


def files(source: Source) -> dict[str, bytes]:
    """One ``.fmu`` file.

    Raises UsageError: the C runtime has no such scheme, or there is no compiler.
    """
    unit = unit_of(source)
    return unit_file(unit, 2, description(unit), {})


def description(unit: Unit) -> str:
    """The text of ``modelDescription.xml``."""
    source, settings, name = unit.source, unit.problem.settings, unit.source.name
    listed = _listed(unit)
    root = element(
        None,
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=name,
        guid=token_of(unit, 2),
        description="; ".join(source.heading),
        generationTool=f"hsdsl {__version__}",
        variableNamingConvention="flat",
        numberOfEventIndicators=str(len(unit.references("indicator"))),
    )
    for tag, further in (
        ("ModelExchange", {"completedIntegratorStepNotNeeded": True}),
        ("CoSimulation", {"canHandleVariableCommunicationStepSize": True}),
    ):
        kind = element(root, tag, modelIdentifier=name, **further, **_CAN)
        files = element(kind, "SourceFiles")
        for file in compiled_names(2):
            element(files, "File", name=file)
    time = source.system.units.get("t")
    define_units(root, [*(_unit(variable, time) for _, variable in listed)])
    element(element(root, "LogCategories"), "Category", name="logStatusError")
    element(root, "DefaultExperiment", startTime=0.0, stopTime=float(settings.until), tolerance=settings.tolerance)
    variables = element(root, "ModelVariables")
    for reference, variable in listed:
        _variable(variables, unit, reference, variable)
    _structure(root, unit)
    return written(root)


def _listed(unit: Unit) -> list[tuple[int, Variable]]:
    """All but event indicators, which have no variables here."""
    return [(i, variable) for i, variable in enumerate(unit.variables) if variable.kind != "indicator"]


def _unit(variable: Variable, time: str | None) -> str | None:
    if variable.kind == "time":
        return None
    return per_time(variable.unit, time) if variable.kind == "derivative" else variable.unit


def _variable(parent: Element, unit: Unit, reference: int, variable: Variable) -> None:
    kinds: dict[str, tuple[str, str, str | None]] = {
        "time": ("independent", "continuous", None),
        "state": ("output", "continuous", "exact"),
        "derivative": ("local", "continuous", "calculated"),
        "parameter": ("parameter", "fixed" if variable.fixed else "tunable", "exact"),
        "input": ("input", "discrete" if variable.discrete else "continuous", None),
        "output": ("output", "continuous", "calculated"),
        "mode": ("output", "discrete", "calculated"),
    }
    causality, variability, initial = kinds[variable.kind]
    start, derivative = variable.start, None
    if variable.kind == "parameter" and start is None:
        causality, initial = "calculatedParameter", "calculated"
    if variable.kind == "input" and variable.fixed:
        causality, variability, initial, start = "local", "continuous", "calculated", None
    if variable.kind == "derivative":
        derivative = str(unit.references("state")[variable.index] + 1)
    scalar = element(
        parent, "ScalarVariable", name=variable.name, valueReference=str(reference), description=variable.about,
        causality=causality, variability=variability, initial=initial,
    )  # fmt: skip
    if variable.kind == "mode":
        element(scalar, "Integer")
        return
    element(
        scalar, "Real", unit=_unit(variable, unit.source.system.units.get("t")), min=variable.minimum,
        max=variable.maximum, nominal=variable.nominal, start=start, derivative=derivative,
    )  # fmt: skip


def _structure(root: Element, unit: Unit) -> None:
    structure = element(root, "ModelStructure")
    calculated = [i for i, v in enumerate(unit.variables) if v.kind == "parameter" and v.start is None]
    lists = {
        "Outputs": unit.references("state", "output", "mode"),
        "Derivatives": unit.references("derivative"),
        "InitialUnknowns": sorted((*unit.references("derivative", "output", "mode"), *calculated)),
    }
    for tag, references in lists.items():
        if references:
            parent = element(structure, tag)
            for reference in references:
                element(parent, "Unknown", index=str(reference + 1))
