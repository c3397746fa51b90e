"""A run screened in C (`runtime/c/screen.c`): where there is surely nothing to find, Python takes no part.

The screen holds for compiled runs by `located` with a tolerance, which noted nothing, end as the finer run does, and
make the same transitions. Of others there is none, and Python decides every hypothesis.

It takes routines as operations on the results of others, one list for each mode, in tables (``hs_screen.h``). Registers
hold time, the states, data, constants and then the result of each operation, those on data alone first. Of a function
that the screen does not know nothing is concluded.
"""

from __future__ import annotations

import ast
import ctypes
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import cache, cached_property, reduce
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.base.numbers.roundoff import BEYOND
from hsdsl.engine.execution import Array, Execution
from hsdsl.engine.runtime import structures
from hsdsl.engine.runtime.kernel import runtime
from hsdsl.engine.simulate.columns import Columns
from hsdsl.engine.simulate.problem import Problem
from hsdsl.engine.simulate.stops import show, wall_of
from hsdsl.engine.simulate.verdict.errors import times
from hsdsl.engine.simulate.verdict.shadow import INSIDE, POLE, ShadowErrors, correction, may_have_shadow, order_of
from hsdsl.mathematics.program import ModeProgram, Program

if TYPE_CHECKING:
    from hsdsl.engine.simulate.compiled import CompiledPlan

MOST_LEFT, MOST_ROOM = 4, 1 << 17  # screens that are kept, and numbers in the memory of one
CROSSING_UNDECIDED, RESET_UNDECIDED = 1, 2
HYPOTHESIS_BITS = {word: 1 << bit for bit, word in enumerate(structures.HYPOTHESES)}


class Margins(NamedTuple):
    """What a screen shows of a run that surely has no finding.

    How many transitions the flow made, the least rate and the least margin; of the turning point that comes closest to
    its surface the margin and the time, its mode (negative for none) and surface.
    """

    crossed: int
    slowest: float
    least: float
    margin: float
    missed: float
    mode: int
    surface: int

    def nearest_miss(self, modes: Sequence[ModeProgram]) -> list[str]:
        """The sentence on that turning point."""
        if self.mode < 0:
            return []
        mode, k = modes[self.mode], self.surface
        edges = mode.edges
        name = edges[k].name if k < len(edges) else f"the wall {wall_of(mode, k)}"
        return [f"the nearest miss is that of {name} at t = {show(self.missed)}, at {times(self.margin)} the error"]


class Screen:
    """What the screen found of one run; ``table`` is its ``hs_screen``, which begins as a copy of ``common``."""

    def __init__(self, common: Any) -> None:
        self.table: Any = structures.Screen.from_buffer_copy(common)
        self._where, self._decide, self._memory = ctypes.addressof(self.table), runtime().hs_screen_run, np.empty(0)
        self.columns: Columns | None = None

    def decide(self, columns: Columns, finer: int | None = None) -> bool:
        """Screen a run, and say whether there is surely nothing to find; ``finer`` is the record of a finer one.

        Without that, the run is compared with its shadow run.
        """
        self.columns = columns
        while (left := self._decide(self._where, columns.record, finer)) > 0:
            self._memory = np.empty(left)
            self.table.workspace, self.table.room = structures.start_of(self._memory), left
        return not left

    @property
    def shadow_errors(self) -> ShadowErrors:
        """How far the run is from its shadow run; only of a run that is compared with one."""
        run = self.table.run
        apart = self._found("shadow_errors", run.rows * run.width, np.float64)
        return ShadowErrors(apart.reshape(run.rows, run.width), self._found("time_errors", run.transitions, np.float64))

    def _found(self, name: str, count: int, kind: Any) -> Array:
        """Numbers of a column that was found."""
        start = getattr(self.table, name) - self.table.workspace
        return self._memory.view(np.uint8)[start : start + count * np.dtype(kind).itemsize].view(kind)

    def undecided(self, *words: str) -> bool:
        """Whether any of these hypotheses is undecided; without words, any at all."""
        if not words:
            return bool(self.table.undecided or self.table.marks)
        return any(self.table.undecided & HYPOTHESIS_BITS[word] for word in words)

    def marked(self, name: str) -> Array:
        """The marks of a column by transition, arc or row."""
        run = self.table.run
        counts = {"crossing": run.transitions, "landing": run.arcs, "ending": run.arcs}
        return self._found(name, counts.get(name, run.rows), np.int32)

    @cached_property
    def first_rows(self) -> Array:
        """The first row of each arc."""
        assert self.columns is not None
        return self.columns["arc"]["first"]

    def arcs(self, name: str) -> set[int]:
        """The first rows of the arcs that are marked."""
        return set(self.first_rows[self.marked(name) != 0].tolist())

    @property
    def margins(self) -> Margins:
        """What it shows of what holds."""
        of = self.table
        return Margins(of.crossed, of.slowest, of.least, of.margin, of.missed, of.missed_mode, of.missed_surface)

    @property
    def commuting(self) -> list[float]:
        """When transitions were reached together of which every order leads to the same point."""
        return [*structures.array_at(ctypes.c_double, self.table.tied_times, self.table.commuting)]


class Screens:
    """Screens of the runs by a plan, compared with shadow runs or finer runs.

    What one leaves can be used by the next.
    """

    def __init__(self, problem: Problem, plan: CompiledPlan, by_shadow: bool) -> None:
        model, settings, method = plan.compiled, problem.settings, problem.settings.method
        formulas: FormulaTables = model.shared("formulas", lambda: FormulaTables(problem.program))
        assert method is not None
        order, start = order_of(method) if by_shadow else None, problem.start if by_shadow else None
        self._start = [np.array(numbers, np.float64) for numbers in ((start.x, start.data) if start else ())]
        self._common = structures.Screen(
            model=ctypes.addressof(model.table),
            timeline=plan.timeline,
            formulas=ctypes.addressof(formulas.table),
            order=order or 0,
            correction=ctypes.addressof(_correction()) if by_shadow and order is None else 0,
            **dict(zip(("start", "data"), (array.ctypes.data for array in self._start), strict=False)),
            until=settings.until,
            relaxation=settings.relaxation,
            tolerance=settings.tolerance,
        )
        modes = problem.program.modes
        self.keep_values = any(len(queue.values) > 1 for mode in modes for queue in mode.queues)  # that wait
        self.final_walls = any(mode.final and mode.walls for mode in modes)
        self._left: list[Screen] = []

    def take(self) -> Screen:
        """Return a screen that nobody reads."""
        try:
            return self._left.pop()
        except IndexError:
            return Screen(self._common)

    def leave(self, screen: Screen) -> None:
        """Let the next run use a screen that nobody reads any more."""
        if len(self._left) < MOST_LEFT and screen.table.room <= MOST_ROOM:
            screen.columns = None
            self._left.append(screen)


def screens_of(plan: CompiledPlan, by_shadow: bool) -> Screens | None:
    """Screens of the runs by a plan, where there are any; see `has_shadow` for those with shadow runs."""
    if by_shadow not in plan.of_screens:
        problem = plan.problem
        located = problem.settings.scheme == "located" and problem.settings.tolerance is not None
        can = located and not any(mode.slides for mode in problem.program.modes)
        can = can and (may_have_shadow(problem) or not by_shadow) and not problem.waits
        plan.of_screens[by_shadow] = Screens(problem, plan, by_shadow) if can else None
    return plan.of_screens[by_shadow]


def screened(run: Execution, finer: Execution | None) -> Screen | None:
    """Screen a run, where that can be done; without a finer run by its shadow run."""
    one: Any = run.compiled
    other: Any = finer and finer.compiled
    if one is None or (finer and other is None):
        return None
    if not run.stop.complete or (finer and finer.stop.reason != run.stop.reason):
        return None
    if one.columns.notes or (other and other.columns.notes):
        return None
    screens = screens_of(one.plan, finer is None)
    if screens is None:
        return None
    screen = screens.take()
    screen.decide(one.columns, other and other.columns.record)
    return screen


@cache
def _correction() -> Any:
    """The coefficients of corrections."""
    numbers = (*(number for each in correction() for number in each.ravel()), INSIDE, POLE)
    return structures.Correction.from_buffer((ctypes.c_double * len(numbers))(*numbers))


MOST_OPERANDS = 4


class FormulaTables:
    """All modes of a program as the screen takes them; ``table`` is their ``hs_formulas``."""

    def __init__(self, program: Program) -> None:
        self._kept: list[Any] = []
        self.registers = 0  # of the mode with most
        found = [self._mode(program, k, mode) for k, mode in enumerate(program.modes)]
        self.table: Any = (structures.Formulas * len(found))(*found)

    def _mode(self, program: Program, index: int, mode: ModeProgram) -> Any:
        data = [f"p{i}" for i in range(len(program.parameters))]
        data += [f"{letter}{i}" for i in range(len(program.inputs)) for letter in "abc"]
        data += [f"k{i}" for i in range(len(program.switches))]
        operations, routines = Operations(len(mode.states), data), _definitions(mode.routines.source)
        surfaces = len(mode.edges) + len(mode.walls)
        names = ["flow", "surfaces", *(f"rate_{k}" for k in range(surfaces))]
        names += [f"reset_{k}" for k in range(len(mode.edges))]
        formulas = [operations.formula(routines[name]) for name in names]
        place = _placed(operations, 1 + len(mode.states) + len(data))
        steps = [
            (structures.OPERATORS.index(kind), *map(place, operands), *(0,) * (MOST_OPERANDS - len(operands)))
            for kind, operands in (*operations.fixed, *operations.moving)
        ]
        self.registers = max(self.registers, 1 + len(mode.states) + len(data) + len(operations.constants) + len(steps))
        flow, values, *others = (self._formula(len(operations.fixed), place, formula) for formula in formulas)
        resets = [results for *_, results in formulas[2 + surfaces :]]
        curved = [len(results) * any(math.isinf(node.degree) for node in results) for results in resets]
        keeps = [_keeps(mode, index, k) for k in range(len(mode.edges))]
        return structures.Formulas(
            constants=len(operations.constants),
            fixed=len(operations.fixed),
            operations=len(steps),
            affine=all(node.degree <= 1 for node in formulas[0][2]),
            steep=mode.steep,
            jumps=mode.jumps,
            constant=self._memory(np.array(list(operations.constants), np.float64)),
            operation=self._memory(np.array(steps, np.int32)),
            flow=flow,
            surfaces=values,
            rate=self._structures(others[:surfaces]),
            reset=self._structures(others[surfaces:]),
            keeps=self._memory(np.array(keeps, np.int32)),
            curved=self._memory(np.array(curved, np.int32)),
        )

    def _memory(self, array: Any) -> int:
        self._kept.append(array)
        return array.ctypes.data

    def _structures(self, each: list[Any]) -> Any:
        self._kept.append((structures.Formula * max(1, len(each)))(*each))
        return ctypes.addressof(self._kept[-1])

    def _formula(self, fixed: int, place: Callable[[Any], int], formula: tuple[int, int, list[Node]]) -> Any:
        first, last, results = formula
        return structures.Formula(first + fixed, last + fixed, self._memory(np.array([*map(place, results)], np.int32)))


def _placed(operations: Operations, data_end: int) -> Callable[[Any], int]:
    """The register of a node; a number is itself."""
    starts = {"state": 0, "data": len(operations.names) - sum(n.source == "data" for n in operations.names.values())}
    starts["constant"] = data_end
    starts["fixed"] = data_end + len(operations.constants)
    starts["moving"] = starts["fixed"] + len(operations.fixed)
    return lambda node: starts[node.source] + node.number if isinstance(node, Node) else node


def _definitions(source: str) -> dict[str, ast.FunctionDef]:
    bind = ast.parse(source).body[0]
    assert isinstance(bind, ast.FunctionDef)
    return {each.name: each for each in bind.body if isinstance(each, ast.FunctionDef)}


def _keeps(mode: ModeProgram, index: int, k: int) -> list[bool]:
    """Say which states the reset of an edge to the mode itself leaves as they are."""
    edge = mode.edges[k]
    if edge.target != index:
        return [False] * len(mode.states)
    return [text == name for name, text in zip(mode.states, edge.reset_texts, strict=True)]


CONSTANT = re.compile(r"q_(m?)(\d+)_(\d+)")
SIGNS: Mapping[type[ast.operator], str] = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Div: "div"}
PLAIN = ("abs", "sqrt", "exp", "log", "sin", "cos", "tanh", "atan", "sign", "floor")
FOLLOWED = ("asin", "acos", "sinh", "cosh", "asinh", "acosh", "atanh", "atan2", "below")  # round-off of which is
MOST_POWER = 1 << 20


class Node(NamedTuple):
    """A value: where it comes from, its number there, and its degree as a polynomial in time and the states."""

    source: str
    number: int
    degree: float


Operation = tuple[str, tuple[Node | int, ...]]


class Operations:
    """The operations of one mode, while they are collected."""

    def __init__(self, states: int, data: Sequence[str]) -> None:
        self.names = {"t": Node("state", 0, 1)} | {f"x{i}": Node("state", i + 1, 1) for i in range(states)}
        self.names |= {name: Node("data", i, 0) for i, name in enumerate(data)}
        self.constants: dict[tuple[float, float, float, float], Node] = {}
        self.fixed: list[Operation] = []
        self.moving: list[Operation] = []
        self._known: dict[Operation, Node] = {}

    def formula(self, definition: ast.FunctionDef) -> tuple[int, int, list[Node]]:
        """Collect one routine: its first operation, the one behind its last, and its results."""
        self._known = {key: node for key, node in self._known.items() if node.source == "fixed"}
        names, first, results = dict(self.names), len(self.moving), list[Node]()
        for statement in definition.body:
            match statement:
                case ast.Assign(value=ast.Subscript()):
                    pass  # a datum under its own name
                case ast.Assign(targets=[ast.Name(id=name)], value=value):
                    names[name] = self._node(value, names)
                case ast.Return(value=ast.Tuple(elts=elements)):
                    results = [self._node(element, names) for element in elements]
                case _:
                    raise ValueError(f"no statement of a routine: {ast.unparse(statement)}")
        return first, len(self.moving), results

    def _node(self, tree: ast.expr, names: dict[str, Node]) -> Node:
        match tree:
            case ast.Name(id=name):
                return names[name] if name in names else self._constant(name)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return self._made("neg", self._node(operand, names))
            case ast.BinOp(left=left, op=sign, right=right) if type(sign) in SIGNS:
                one, other = self._node(left, names), self._node(right, names)
                if isinstance(sign, ast.Mult) and one == other:
                    return self._made("square", one)
                return self._made(SIGNS[type(sign)], one, other)
            case ast.Call(func=ast.Name(id=name), args=arguments):
                return self._called(name, arguments, names)
            case _:
                return self._unknown()

    def _called(self, name: str, arguments: list[ast.expr], names: dict[str, Node]) -> Node:
        if name == "pow":
            return self._power(*arguments, names=names)
        nodes = [self._node(argument, names) for argument in arguments]
        if name in PLAIN or name in FOLLOWED:
            return self._made(name, *nodes)
        if name in ("min", "max"):
            return reduce(lambda one, other: self._made(name, one, other), nodes)
        if name == "tan":
            return self._made("div", self._made("sin", nodes[0]), self._made("cos", nodes[0]))
        if name == "heaviside":
            half, one = self._kept(0.5, 0.5, 0.5), self._kept(1.0, 1.0, 1.0)
            return self._made("mul", half, self._made("add", one, self._made("sign", nodes[0])))
        return self._unknown()

    def _power(self, base: ast.expr, exponent: ast.expr, *, names: dict[str, Node]) -> Node:
        found = CONSTANT.fullmatch(exponent.id) if isinstance(exponent, ast.Name) else None
        whole = int(found[2]) if found and not found[1] and found[3] == "1" else 0
        if 0 < whole < MOST_POWER:
            return self._made("power", self._node(base, names), whole)
        return self._made("pow", self._node(base, names), self._node(exponent, names))

    def _constant(self, name: str) -> Node:
        if found := CONSTANT.fullmatch(name):
            exact = Fraction(int(found[2]) * (-1 if found[1] else 1), int(found[3]))
            if abs(exact) > sys.float_info.max:
                return self._unknown()
            nearest = float(exact)
            return self._around(nearest, float(exact - Fraction(nearest)))
        nearest = FLOAT64.functions.get(name)
        if isinstance(nearest, float) and math.isfinite(nearest):
            return self._around(nearest, BEYOND[name])
        return self._unknown()

    def _around(self, nearest: float, error: float) -> Node:
        if not error:
            return self._kept(nearest, nearest, nearest)
        return self._kept(math.nextafter(nearest, -math.inf), math.nextafter(nearest, math.inf), nearest, error)

    def _kept(self, low: float, high: float, nearest: float, error: float = 0.0) -> Node:
        return self.constants.setdefault((low, high, nearest, error), Node("constant", len(self.constants), 0))

    def _unknown(self) -> Node:
        """Give what may be anything; its operand does not matter."""
        return self._made("unknown", self.names["t"])

    def _made(self, kind: str, *operands: Node | int) -> Node:
        key = kind, operands
        if key not in self._known:
            nodes = [node for node in operands if isinstance(node, Node)]
            fixed = all(node.source in ("data", "constant", "fixed") for node in nodes)
            operations = self.fixed if fixed else self.moving
            operations.append(key)
            made = Node("fixed" if fixed else "moving", len(operations) - 1, _degree(kind, nodes))
            self._known[key] = made
        return self._known[key]


def _degree(kind: str, nodes: Sequence[Node]) -> float:
    degrees = [node.degree for node in nodes]
    if kind in ("add", "sub", "neg"):
        return max(degrees)
    if kind == "mul":
        return sum(degrees)
    if kind == "div" and degrees[1] == 0:
        return degrees[0]
    return 0 if max(degrees) == 0 and kind != "unknown" else math.inf
