"""A functional mock-up unit of FMI 3.0, for model exchange and co-simulation."""

from __future__ import annotations

from hsdsl import __version__
from hsdsl.export.fmi.archive import compiled_names, token_of, unit_file
from hsdsl.export.fmi.variables import Unit, Variable, unit_of
from hsdsl.export.fmi.xml import Element, define_units, element, per_time, written
from hsdsl.export.source import Source

_CAN = {
    "canGetAndSetFMUState": True,
    "canSerializeFMUState": True,
    "providesDirectionalDerivatives": True,
    "providesAdjointDerivatives": True,
}


def files(source: Source) -> dict[str, bytes]:
    """One ``.fmu`` file.

    Raises UsageError: the C runtime has no such scheme, or there is no compiler.
    """
    unit = unit_of(source)
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
    source, settings, name = unit.source, unit.problem.settings, unit.source.name
    root = element(
        None,
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=name,
        instantiationToken=token_of(unit, 3),
        description="; ".join(source.heading),
        generationTool=f"hsdsl {__version__}",
        variableNamingConvention="flat",
    )
    element(root, "ModelExchange", modelIdentifier=name, needsCompletedIntegratorStep=False, **_CAN)
    element(
        root,
        "CoSimulation",
        modelIdentifier=name,
        canHandleVariableCommunicationStepSize=True,
        hasEventMode=True,
        **_CAN,
    )
    time = source.system.units.get("t")
    define_units(root, [*(_unit(variable, time) for variable in unit.variables)])
    categories = element(root, "LogCategories")
    for category in ("logStatusError", "logEvents"):
        element(categories, "Category", name=category)
    element(root, "DefaultExperiment", startTime=0.0, stopTime=float(settings.until), tolerance=settings.tolerance)
    variables = element(root, "ModelVariables")
    for reference, variable in enumerate(unit.variables):
        _variable(variables, unit, reference, variable)
    _structure(root, unit)
    return written(root)


def _unit(variable: Variable, time: str | None) -> str | None:
    if variable.kind == "time":
        return time
    return per_time(variable.unit, time) if variable.kind == "derivative" else variable.unit


def _variable(parent: Element, unit: Unit, reference: int, variable: Variable) -> None:
    named = {"name": variable.name, "valueReference": str(reference), "description": variable.about}
    kinds = {
        "time": {"causality": "independent", "variability": "continuous"},
        "state": {"causality": "output", "variability": "continuous", "initial": "exact"},
        "derivative": {"causality": "local", "variability": "continuous", "initial": "calculated"},
        "parameter": {"causality": "parameter", "variability": "fixed" if variable.fixed else "tunable"},
        "input": {"causality": "input", "variability": "discrete" if variable.discrete else "continuous"},
        "output": {"causality": "output", "variability": "continuous", "initial": "calculated"},
        "mode": {"causality": "output", "variability": "discrete", "initial": "calculated"},
        "indicator": {"causality": "local", "variability": "continuous", "initial": "calculated"},
    }
    kind, start = kinds[variable.kind], variable.start
    if variable.kind == "parameter":
        kind |= {"initial": "exact"}
        if start is None:
            kind |= {"causality": "calculatedParameter", "initial": "calculated"}
    if variable.kind == "input" and variable.fixed:
        kind, start = {"causality": "local", "variability": "continuous", "initial": "calculated"}, None
    derivative = None
    if variable.kind == "derivative":
        derivative = str(unit.references("state")[variable.index])
    if variable.kind == "mode":
        element(parent, "Int32", **named, **kind)
        return
    element(
        parent, "Float64", **named, **kind, unit=_unit(variable, unit.source.system.units.get("t")),
        min=variable.minimum, max=variable.maximum, nominal=variable.nominal, start=start, derivative=derivative,
    )  # fmt: skip


def _structure(root: Element, unit: Unit) -> None:
    structure = element(root, "ModelStructure")
    for reference in unit.references("state", "output", "mode"):
        element(structure, "Output", valueReference=str(reference))
    for reference in unit.references("derivative"):
        element(structure, "ContinuousStateDerivative", valueReference=str(reference))
    calculated = [i for i, v in enumerate(unit.variables) if v.kind == "parameter" and v.start is None]
    for reference in sorted((*unit.references("derivative", "output", "mode"), *calculated)):
        element(structure, "InitialUnknown", valueReference=str(reference))
    for reference in unit.references("indicator"):
        element(structure, "EventIndicator", valueReference=str(reference))
