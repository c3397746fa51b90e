"""Maps of outcomes over a plane of settings and numbers: where methods converge, and how they fail where they do not.

=============  =====================================================================
`axes`         what varies, read from text
`cells`        the outcome of one run, against a reference at the same numbers
`limits`       known limits of linear stability
`table`        a map as CSV, as plain values and as text
`picture`      a map as a picture
=============  =====================================================================
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hsdsl.base.errors import UsageError
from hsdsl.base.limits import cores
from hsdsl.base.names import did_you_mean
from hsdsl.base.processes import Lost, in_processes
from hsdsl.engine.integrators import METHODS
from hsdsl.engine.simulate import SCHEMES
from hsdsl.interface.chart.peers import PEERS
from hsdsl.interface.chart.result import Tool
from hsdsl.interface.chart.stability.axes import SIZES, Axis, read_axes
from hsdsl.interface.chart.stability.cells import STUCK, WORDS, Bench, Cell
from hsdsl.interface.chart.stability.limits import eigenvalues, largest_step
from hsdsl.interface.model import Model

__all__ = ["WORDS", "Axis", "Cell", "Panel", "StabilityMap", "stability_map"]
Progress = Callable[[int, int], None]
PLANE = "h,relaxation"  # that of the paper's Fig. 14


@dataclass(frozen=True)
class Panel:
    """A tool's outcomes; ``cells[j][i]`` is at value j of y and value i of x.

    ``limit`` has the largest stable step at each value of y, or is None where none is known.
    """

    tool: Tool
    cells: tuple[tuple[Cell, ...], ...]
    limit: tuple[float | None, ...] | None


@dataclass(frozen=True)
class StabilityMap:
    """A plane of outcomes for each tool."""

    name: str
    x: Axis
    y: Axis
    panels: tuple[Panel, ...]


def stability_map(
    model: Model,
    map: str = PLANE,
    *,
    schemes: str | Sequence[str] = (),
    methods: str | Sequence[str] = (),
    against: str | Sequence[str] = (),
    parameters: Mapping[str, Any] | None = None,
    initial: Mapping[str, Any] | None = None,
    settings: Mapping[str, Any] | None = None,
    with_rho: bool = True,
    processes: int | None = None,
    patience: float = 10.0,
    watch: Progress = lambda done, count: None,
) -> StabilityMap:
    """Run a model over a plane, on all cores, and say what comes of each run.

    Parameters
    ----------
    map : str
        Two axes as ``"h=1e-4:1e-1:20,relaxation"``, see :func:`hsdsl.interface.chart.stability.axes.read_axes`.
    schemes, methods : str or sequence of str
        Ours, a panel for each pair; left out, ``relaxed`` on maps of relaxation, the file's scheme on others, and rk4
        on maps of h, auto on others.
    against : str or sequence of str
        Names, with commas between them in one text, of :data:`hsdsl.interface.chart.PEERS`; they take no step.
    parameters, initial, settings : mapping, optional
        Overrides of every run.
    with_rho : bool
        Compute rho of the runs that get to the end.
    processes : int, optional
        Left out, as many as there are cores for this process.
    patience : float
        Processor seconds of a run; a longer one is stuck.
    watch : callable
        Called with how many runs are done, and how many there are.

    Raises UsageError: a name that cannot be varied, an empty range, or settings that no run can have.
    """
    base = {"parameters": dict(parameters or {}), "initial": dict(initial or {}), "settings": dict(settings or {})}
    until = float(model.pipeline.prepare(base).settings.until)
    x, y = read_axes(model, map, until, base)
    _check_free(base, (x, y))
    schemes, against = _named(schemes, SCHEMES, "--scheme"), _named(against, PEERS, "--against")
    methods = _named(methods, ("auto", *METHODS), "--method")
    tools = _tools(model, schemes, methods, against, {x.kind, y.kind})
    _check_ends(model, base, (x, y))
    bench = Bench(model, with_rho)
    places = [(k, j, i) for j in range(len(y.values)) for i in range(len(x.values)) for k in range(len(tools))]
    found: dict[tuple[int, int, int], Cell] = {}

    def work(place: tuple[int, int, int]) -> Cell:
        k, j, i = place
        return bench.run(tools[k], y.onto(x.onto(base, x.values[i]), y.values[j]))

    for index, answer in in_processes(work, places, processes or cores(), patience):
        lost = isinstance(answer, Lost)
        found[places[index]] = Cell(STUCK, why=f"it {answer.word}") if lost else answer
        watch(len(found), len(places))
    grids = [
        tuple(tuple(found[k, j, i] for i in range(len(x.values))) for j in range(len(y.values)))
        for k in range(len(tools))
    ]
    panels = tuple(
        Panel(tool, cells, _limit(model, base, tool, x, y)) for tool, cells in zip(tools, grids, strict=True)
    )
    return StabilityMap(os.path.basename(model.program.path).removesuffix(".yaml"), x, y, panels)


def _check_free(base: Mapping[str, Mapping[str, Any]], axes: Sequence[Axis]) -> None:
    """Refuse an axis that ``--set`` has fixed."""
    for axis in axes:
        group = "settings" if axis.name in SIZES else "initial" if axis.kind == "initial" else "parameters"
        name = axis.kind if group == "settings" else axis.name.removeprefix("initial.")
        if name in base[group]:
            raise UsageError(f"--map {axis.name}: it is fixed by --set", "leave out one of the two")


def _check_ends(model: Model, base: Mapping[str, Any], axes: Sequence[Axis]) -> None:
    """Refuse numbers outside what the file allows, before anything runs."""
    for axis in axes:
        if axis.kind in ("parameter", "initial"):
            for value in (axis.values[0], axis.values[-1]):
                model.pipeline.prepare(axis.onto(base, value))


def _named(names: str | Sequence[str], known: Collection[str], option: str) -> list[str]:
    """Names that are given alone, or in a text with commas between them."""
    found = [name.strip() for name in names.split(",") if name.strip()] if isinstance(names, str) else list(names)
    for name in found:
        if name not in known:
            raise UsageError(f"{option}: there is no '{name}'", did_you_mean(name, known))
    return found


def _tools(
    model: Model, schemes: Sequence[str], methods: Sequence[str], against: Sequence[str], kinds: set[str]
) -> list[Tool]:
    """Schemes with methods, and peers."""
    schemes = list(schemes) or ["relaxed" if "relaxation" in kinds else model.resolve().scheme]
    named = list(methods) or ["rk4" if "step" in kinds else "auto"]
    if "step" in kinds and against:
        raise UsageError("--against: peers choose their own steps, so a map of h cannot show them", "map tolerance")
    for method in named if "tolerance" in kinds else ():
        if method in METHODS and not METHODS[method].adaptive:
            raise UsageError(f"method {method}: it has a fixed step and keeps no tolerance", "map h")
    found = [
        Tool("", scheme, method if scheme != "paoli-schatzman" else "")
        for scheme in schemes
        for method in (named if scheme != "paoli-schatzman" else named[:1])
    ]
    return [*found, *(Tool(name) for name in against)]


def _limit(model: Model, base: Mapping[str, Any], tool: Tool, x: Axis, y: Axis) -> tuple[float | None, ...] | None:
    """The largest stable step at each value of y, where x is the step and the flow is linear."""
    if x.kind != "step" or tool.name or not tool.method:
        return None
    found: list[float | None] = []
    for value in y.values:
        given = y.onto(base, value)
        values = eigenvalues(model, {group: given[group] for group in ("parameters", "initial")})
        found.append(None if values is None else largest_step(tool.method, values, x.values[0] / 10, x.values[-1] * 10))
    return tuple(found) if any(found) else None
