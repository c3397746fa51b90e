"""What the model descriptions of both versions of FMI share: the root, and what a variable is to the caller."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hsdsl import __version__
from hsdsl.export.fmi.archive import token_of
from hsdsl.export.fmi.dependencies import dependencies, initial_dependencies
from hsdsl.export.fmi.variables import Unit, Variable
from hsdsl.export.fmi.xml import Element, element, per_time

_KINDS = {  # causality, variability, initial
    "time": ("independent", "continuous", None),
    "state": ("output", "continuous", "exact"),
    "derivative": ("local", "continuous", "calculated"),
    "parameter": ("parameter", "tunable", "exact"),
    "input": ("input", "continuous", None),
    "output": ("output", "continuous", "calculated"),
    "mode": ("local", "discrete", "calculated"),
    "indicator": ("local", "continuous", "calculated"),
}


def root_of(unit: Unit, version: int, **further: str) -> Element:
    """The root of ``modelDescription.xml``."""
    return element(
        None, "fmiModelDescription", fmiVersion=f"{version}.0", modelName=unit.source.name,
        **{"guid" if version == 2 else "instantiationToken": token_of(unit, version)},
        description="; ".join(unit.source.heading), generationTool=f"hsdsl {__version__}",
        variableNamingConvention="flat", **further,
    )  # fmt: skip


def define_experiment(root: Element, unit: Unit, categories: tuple[str, ...]) -> None:
    """The categories of messages, and the default experiment."""
    settings, listed = unit.problem.settings, element(root, "LogCategories")
    for category in categories:
        element(listed, "Category", name=category)
    element(root, "DefaultExperiment", startTime=0.0, stopTime=float(settings.until), tolerance=settings.tolerance)


def unit_of_measure(unit: Unit, variable: Variable) -> str | None:
    """The unit of a variable; that of a derivative is by time."""
    time = unit.source.system.units.get("t")
    if variable.kind == "time":
        return time
    return per_time(variable.unit, time) if variable.kind == "derivative" else variable.unit


def named(unit: Unit, variable: Variable, reference: int) -> dict[str, Any]:
    """The attributes of a variable that say what it is called and what it is to the caller."""
    causality, variability, initial = _KINDS[variable.kind]
    if variable.kind == "mode":
        causality = unit.modes
    if variable.kind == "parameter" and variable.fixed:
        variability = "fixed"
    if variable.kind == "input" and variable.discrete:
        variability = "discrete"
    if variable.kind == "parameter" and variable.start is None:
        causality, initial = "calculatedParameter", "calculated"
    if variable.kind == "input" and variable.fixed:
        causality, variability, initial = "local", "continuous", "calculated"
    return {
        "name": variable.name, "valueReference": str(reference), "description": variable.about,
        "causality": causality, "variability": variability, "initial": initial,
    }  # fmt: skip


def numbers(unit: Unit, variable: Variable, offset: int) -> dict[str, Any]:
    """The attributes of a real variable: its unit, bounds, start, and the state that it is the derivative of.

    States are numbered from ``offset`` on.
    """
    derived = variable.kind == "derivative"
    return {
        "min": variable.minimum, "max": variable.maximum, "nominal": variable.nominal,
        "start": None if variable.kind == "input" and variable.fixed else variable.start,
        "derivative": str(unit.references("state")[variable.index] + offset) if derived else None,
    }  # fmt: skip


def outputs(unit: Unit) -> list[int]:
    """What the caller takes for outputs."""
    return unit.references("state", "output", *(("mode",) if unit.modes == "output" else ()))


def initial_unknowns(unit: Unit) -> list[int]:
    """What is computed at the start: derivatives, outputs, and parameters that depend on others."""
    calculated = [i for i, v in enumerate(unit.variables) if v.kind == "parameter" and v.start is None]
    states = unit.references("state")
    return sorted((*(i for i in outputs(unit) if i not in states), *unit.references("derivative"), *calculated))


def structure(
    root: Element, unit: Unit, listed: Mapping[str, tuple[Sequence[int], str]], reference: str, first: int
) -> None:
    """The structure of a model: for each list of unknowns its elements, by an attribute, with what each depends on.

    ``listed`` has for each element's tag the unknowns and the element around them, if there is one; references are
    numbered from ``first`` on.
    """
    parent, always, initially = element(root, "ModelStructure"), dependencies(unit), initial_dependencies(unit)
    for kind, (unknowns, tag) in listed.items():
        known = initially if kind.startswith("Initial") else always
        around = element(parent, kind) if unknowns and kind != tag else parent
        for unknown in unknowns:
            numbers = " ".join(str(i + first) for i in known[unknown])
            element(around, tag, **{reference: str(unknown + first)}, dependencies=numbers)
