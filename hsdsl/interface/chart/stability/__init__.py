"""Maps of outcomes over a plane of settings and numbers: where methods converge, and how they fail where they do not.

Here is the map: its two axes, read from text, its runs, and itself as CSV, as plain values and as text. `cells` has the
outcome of one run and known limits of linear stability; `picture` draws a map.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from hsdsl.analysis.report.words import condensed, form
from hsdsl.base.defaults import SCHEMES
from hsdsl.base.errors import UsageError
from hsdsl.base.limits import cores
from hsdsl.base.names import did_you_mean, shown
from hsdsl.base.processes import Lost, in_processes
from hsdsl.engine.integrators import METHODS
from hsdsl.interface.chart.peers import PEERS
from hsdsl.interface.chart.rows import csv_text
from hsdsl.interface.chart.scene import Tool
from hsdsl.interface.chart.stability.cells import REFUSED, STUCK, UNKNOWN, WORDS, Bench, Cell, eigenvalues, largest_step
from hsdsl.interface.model import Model
from hsdsl.interface.model.differentiate import start_by

__all__ = ["WORDS", "Axis", "Cell", "Panel", "StabilityMap", "stability_map"]
Progress = Callable[[int, int], None]
PLANE = "h,relaxation"  # that of the paper's Fig. 14


class Panel(NamedTuple):
    """A tool's outcomes; ``cells[j][i]`` is at value j of y and value i of x.

    ``limit`` has the largest stable step at each value of y, or is None where none is known.
    """

    tool: Tool
    cells: tuple[tuple[Cell, ...], ...]
    limit: tuple[float | None, ...] | None


class StabilityMap(NamedTuple):
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
        Two axes as ``"h=1e-4:1e-1:20,relaxation"``, see :func:`hsdsl.interface.chart.stability.read_axes`.
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
    for axis in (x, y):
        group = "settings" if axis.name in SIZES else "initial" if axis.kind == "initial" else "parameters"
        name = axis.kind if group == "settings" else axis.name.removeprefix("initial.")
        if name in base[group]:
            raise UsageError(f"--map {axis.name}: it is fixed by --set", "leave out one of the two")
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


SIZES = {"h": "step", "step": "step", "tolerance": "tolerance", "relaxation": "relaxation"}
COUNT, MOST, MOST_CELLS = 12, 400, 40_000
DEFAULTS = {"step": (1e-5, 1e-1), "tolerance": (1e-12, 1e-2), "relaxation": (1e-10, 1e-2)}
IN_TIME = ("step", "relaxation")  # their default ranges are shares of a run
EXAMPLE = "for example --map h=1e-4:1e-1:20,relaxation=1e-8:1e-2:20"


class Axis(NamedTuple):
    """What varies: ``kind`` is a setting (step, tolerance, relaxation), ``parameter`` or ``initial``."""

    name: str
    kind: str
    values: tuple[float, ...]
    logarithmic: bool
    unit: str = ""

    @property
    def label(self) -> str:
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def onto(self, arguments: Mapping[str, Any], value: float) -> dict[str, Any]:
        """The arguments of a run with a value of this axis among them."""
        if self.kind in DEFAULTS:
            return {**arguments, self.kind: value}
        group = "parameters" if self.kind == "parameter" else "initial"
        return {**arguments, group: {**arguments.get(group, {}), self.name.removeprefix("initial."): value}}


def read_axes(model: Model, text: str, until: float, base: Mapping[str, Any]) -> tuple[Axis, Axis]:
    """Read ``NAME[=FROM:TO[:COUNT[:lin]]],NAME[=...]``; values are spaced logarithmically, or evenly with ``lin``.

    ``base`` has the parameters and initial values of all runs, about which a number varies that has no range.

    Raises UsageError: not two different names, a name that cannot vary, or a range that is empty or no range.
    """
    parts = [part.strip() for part in text.split(",") if part.strip()]
    if len(parts) != 2:
        raise UsageError(f"--map: expected two names with a comma between them, got '{shown(text)}'", EXAMPLE)
    x, y = (_axis(model, part, until, base) for part in parts)
    setting = x.kind in DEFAULTS and x.kind == y.kind
    if x.name == y.name:
        raise UsageError(f"--map: expected two names, got {x.name} twice", EXAMPLE)
    if setting or {x.kind, y.kind} == {"step", "tolerance"}:
        raise UsageError(f"--map: {x.name} and {y.name} exclude each other", EXAMPLE)
    if len(x.values) * len(y.values) > MOST_CELLS:
        raise UsageError(f"--map: expected at most {MOST_CELLS:,} runs, got {len(x.values) * len(y.values):,}")
    units = model.program.units
    names = ("t" if axis.kind == "step" else axis.name.removeprefix("initial.") for axis in (x, y))
    return x._replace(unit=units.get(next(names), "")), y._replace(unit=units.get(next(names), ""))


def _axis(model: Model, part: str, until: float, base: Mapping[str, Any]) -> Axis:
    name, equals, range_ = (piece.strip() for piece in part.partition("="))
    kind = SIZES.get(name) or _kind(model, name)
    if equals:
        values, logarithmic = _range(name, range_)
        if kind in DEFAULTS and values[0] <= 0:
            raise UsageError(f"--map {name}: expected positive ends, got '{shown(range_)}'", EXAMPLE)
        return Axis(name, kind, values, logarithmic)
    if kind in DEFAULTS:
        low, high = (end * (until if kind in IN_TIME else 1.0) for end in DEFAULTS[kind])
        return Axis(name, kind, _spaced(low, high, COUNT), True)
    values = model.pipeline.values(parameters=base.get("parameters", {}))
    value = start_by([name], base, values)[1][name]
    if not value > 0:
        raise UsageError(f"--map {name}: its value is {value:g}, so give a range", f"for example {name}=-1:1:20:lin")
    return Axis(name, kind, _spaced(value / 10, value * 10, COUNT), True)


def _kind(model: Model, name: str) -> str:
    """Which group a name belongs to.

    Raises UsageError: the model does not let it vary.
    """
    parameters, states = list(model.program.parameters), list(model.program.all_states)
    if name in parameters:
        return "parameter"
    group, dot, state = name.partition(".")
    if dot and group == "initial" and state in states:
        return "initial"
    if name in model.columns or name == "t":
        kind = "time" if name == "t" else "a state" if name in states else "an output"
        hint = f"map initial.{name}" if name in states else None
        raise UsageError(f"--map {name}: it is {kind}, which a run computes, so it cannot be varied", hint)
    known = [*SIZES, *parameters, *(f"initial.{state}" for state in states)]
    raise UsageError(
        f"--map: there is no setting, parameter or initial value '{shown(name)}'", did_you_mean(name, known)
    )


def _range(name: str, text: str) -> tuple[tuple[float, ...], bool]:
    pieces = text.split(":")
    even = pieces[-1] == "lin"
    pieces = pieces[:-1] if even else pieces
    try:
        low, high = float(pieces[0]), float(pieces[1])
        count = int(pieces[2]) if len(pieces) > 2 else COUNT
    except (ValueError, IndexError):
        count = low = high = 0
    if len(pieces) not in (2, 3) or not (isfinite(low) and isfinite(high)) or count == 0 == low == high:
        raise UsageError(f"--map {name}: expected FROM:TO:COUNT, got '{shown(text)}'", EXAMPLE)
    if not (low < high and 2 <= count <= MOST):
        raise UsageError(f"--map {name}: expected FROM below TO and 2 to {MOST} values, got '{shown(text)}'", EXAMPLE)
    if even:
        return tuple(np.linspace(low, high, count).tolist()), False
    if low <= 0:
        raise UsageError(
            f"--map {name}: expected positive ends, got '{shown(text)}'", f"evenly: {name}={shown(text)}:lin"
        )
    return _spaced(low, high, count), True


def _spaced(low: float, high: float, count: int) -> tuple[float, ...]:
    return tuple(np.geomspace(low, high, count).tolist())


COLUMNS = ("tool", "scheme", "method", "outcome", "rho", "error", "transitions", "why")


def records(found: StabilityMap) -> Iterator[dict[str, Any]]:
    """A mapping for each run."""
    for panel in found.panels:
        for j, row in enumerate(panel.cells):
            for i, cell in enumerate(row):
                place = {found.x.name: found.x.values[i], found.y.name: found.y.values[j]}
                yield place | _plain(panel, cell)


def _plain(panel: Panel, cell: Cell) -> dict[str, Any]:
    numbers = {name: value if isfinite(value) else None for name, value in (("rho", cell.rho), ("error", cell.error))}
    tool = {"tool": panel.tool.name or "hsdsl", "scheme": panel.tool.scheme, "method": panel.tool.method}
    return tool | {"outcome": cell.word} | numbers | {"transitions": cell.transitions, "why": cell.why}


def as_csv(found: StabilityMap) -> str:
    """The map as CSV, a line for each run."""
    return csv_text((found.x.name, found.y.name, *COLUMNS), records(found))


def as_plain(found: StabilityMap) -> dict[str, Any]:
    """What ``--json`` prints."""
    limits = {panel.tool.label: panel.limit for panel in found.panels if panel.limit}
    axes = {"x": found.x.name, "y": found.y.name}
    return {"model": found.name, **axes, "limits": limits, "runs": list(records(found))}


def as_text(found: StabilityMap) -> str:
    """How many runs of each tool came to what, and why there was nothing to run or to compare with."""
    width = max(len(panel.tool.label) for panel in found.panels)
    lines: list[str] = []
    for panel in found.panels:
        count = Counter(cell.word for row in panel.cells for cell in row)
        words = ", ".join(f"{count[word]} {word}" for word in WORDS if count[word])
        limits = [limit for limit in panel.limit or () if limit]
        known = f"; linearly stable up to h = {min(limits):.3g}" if limits else ""
        known += f" to {max(limits):.3g}" if limits and max(limits) > 1.001 * min(limits) else ""
        lines.append(f"{panel.tool.label:{width}}  {words}{known}")
    return "\n".join([*lines, *_reasons(found)])


def _reasons(found: StabilityMap) -> Iterator[str]:
    """Why runs have no reference or are refused: each reason once, with its first place."""
    groups: dict[tuple[str, str], dict[tuple[float, float], str]] = {}
    for panel in found.panels:
        for y, row in zip(found.y.values, panel.cells, strict=True):
            for x, cell in zip(found.x.values, row, strict=True):
                if cell.word in (UNKNOWN, REFUSED):
                    groups.setdefault((cell.word, form(cell.why)), {})[x, y] = cell.why
    for (word, _), places in groups.items():
        x, y = next(iter(places))
        first = f"first at {found.x.name} = {x:.4g}, {found.y.name} = {y:.4g}"
        yield f"{word}, {first}: {condensed([*places.values()])[0]}"
