"""The Python kernel: generated text of routines, executed as Python functions over any number type.

The text comes from `lower`; it names states, parameters and constants only by number, so nothing a model file says
reaches the interpreter as code.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from fractions import Fraction
from textwrap import indent
from typing import Any

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Arithmetic, Number
from hsdsl.engine.kernel import ModeKernel, Routine, Taylor, Vector
from hsdsl.mathematics.program import EdgeProgram, Program, Routines


class PythonKernel:
    """A program over one number type. Modes are compiled when they are first entered.

    ``constants`` are the routines of ``Program.constants`` by name.
    """

    def __init__(self, program: Program, arithmetic: Arithmetic) -> None:
        self.arithmetic = arithmetic
        self._program = program
        self._over: dict[str, PythonKernel] = {}
        self._modes: dict[int, Callable[..., tuple[Routine, ...]]] = {}
        self._apart: dict[int, Callable[..., tuple[Routine, ...]]] = {}
        self._tapes: dict[int, Callable[[Sequence[Number]], Taylor]] = {}
        self._further: dict[tuple[int, str], Callable[..., tuple[Routine, ...]]] = {}
        self._switches: dict[str, Callable[..., tuple[Routine, ...]]] = {}
        self._bound: dict[int, tuple[Sequence[Number], ModeKernel]] = {}
        constants = compile_routines(program.constants, arithmetic, "constants")
        self.constants = dict(zip(program.constants.names, constants(), strict=True))

    @property
    def enclosing(self) -> PythonKernel:
        """The same program over interval arithmetic."""
        from hsdsl.base.numbers.enclosures import ENCLOSED  # only verdicts ask for it

        return self.over(ENCLOSED)

    def over(self, arithmetic: Arithmetic) -> PythonKernel:
        """The same program over another number type."""
        if arithmetic.name not in self._over:
            self._over[arithmetic.name] = PythonKernel(self._program, arithmetic)
        return self._over[arithmetic.name]

    def constant(self, name: str, parameters: Sequence[Number]) -> Vector:
        """Evaluate one of ``Program.constants``' routines at parameter values."""
        return self.constants[name](*parameters)

    def switching(self, data: Sequence[Number]) -> dict[str, Routine]:
        """Return the routines of ``Program.switching`` by name."""
        return self._switching(self.arithmetic, data)

    def enclosed_switching(self, data: Sequence[Any]) -> dict[str, Routine]:
        """Return them over ranges of numbers."""
        from hsdsl.base.numbers.enclosures import ENCLOSED  # only models with switches that are not linear pay for it

        return self._switching(ENCLOSED, data)

    def _switching(self, arithmetic: Arithmetic, data: Sequence[Any]) -> dict[str, Routine]:
        routines = self._program.switching
        if arithmetic.name not in self._switches:
            self._switches[arithmetic.name] = compile_routines(routines, arithmetic, "switches")
        return dict(zip(routines.names, self._switches[arithmetic.name](*data), strict=True))

    def bind(self, mode: int, data: Sequence[Number]) -> ModeKernel:
        """Bind a mode to parameter values and input segments; the last binding of each mode is kept."""
        last = self._bound.get(mode)
        if last is None or last[0] is not data or not isinstance(data, tuple):  # what else there is may have changed
            last = self._bound[mode] = data, self._bind(mode, data)
        return last[1]

    def _bind(self, mode: int, data: Sequence[Number]) -> ModeKernel:
        routines = self._program.flows[mode].routines
        if mode not in self._modes:
            self._modes[mode] = compile_routines(routines, self.arithmetic, f"mode {mode}")
        bound = dict(zip(routines.names, self._modes[mode](*data), strict=True))
        program = self._program.flows[mode]
        if program.ends and (self._program.inputs or self._program.switches):
            bound["flow"] = beside(bound["flow"], self.arithmetic.unit)
        n, zero = len(program.states), self.arithmetic.zero
        slopes = (spread_out(bound[f"gradient_{k}"], row, n + 1, zero) for k, row in enumerate(program.slopes))
        return ModeKernel(
            **{name: bound[name] for name in PLAIN},
            outputs=self._outputs(mode, data, bound["outputs"]),
            gradients=tuple(slopes),
            rates=tuple(bound[f"rate_{k}"] for k in range(len(program.slopes))),
            conditions=tuple(conjunction([bound[name] for name in parts]) for parts in program.conditions),
            resets=tuple(changed(bound[f"reset_{k}"], edge, 1) for k, edge in enumerate(program.edges)),
            spreads=tuple(changed(bound[f"spread_{k}"], edge, n + 1) for k, edge in enumerate(program.edges)),
        )

    def _outputs(self, mode: int, data: Sequence[Number], together: Routine) -> Routine:
        """Evaluate outputs together; each apart, compiled on first use, where one of them has no value."""

        def outputs(*arguments: Number) -> Vector:
            try:
                return together(*arguments)
            except DOMAIN_ERRORS:
                if mode not in self._apart:
                    text = each_apart(self._program.flows[mode].routines, "outputs")
                    self._apart[mode] = compile_routines(text, self.arithmetic, f"outputs of mode {mode}")
                return self._apart[mode](*data)[0](*arguments)

        return outputs

    def taylor(self, mode: int, data: Sequence[Number]) -> Taylor | None:
        """Return Taylor coefficients along a mode's flow; None where the flow is kinked."""
        from hsdsl.engine.backends.taylor import compile_tape  # only Taylor's method needs it

        program = self._program.flows[mode]
        if program.tape is None:
            return None
        if mode not in self._tapes:
            self._tapes[mode] = compile_tape(program.tape, len(program.states), self.arithmetic, f"mode {mode}")
        return self._tapes[mode](data)

    def jacobian(self, mode: int, data: Sequence[Number]) -> Routine:
        """Return the derivatives of a mode's flow by its states; compiled on first use."""
        program = self._program.flows[mode]
        routine = self._compiled(mode, program.jacobian.routines, data)
        return spread_out(routine, program.jacobian.places, len(program.states) ** 2, self.arithmetic.zero)

    def terms(self, mode: int, data: Sequence[Number]) -> Routine | None:
        """Return the sizes of the terms of a mode's flow; None if last digits tell them."""
        routines = self._program.flows[mode].terms
        return None if routines is None else self._compiled(mode, routines, data)

    def _compiled(self, mode: int, routines: Routines, data: Sequence[Number]) -> Routine:
        """The one routine of some that few runs need; compiled on first use."""
        (name,) = routines.names
        if (mode, name) not in self._further:
            self._further[mode, name] = compile_routines(routines, self.arithmetic, f"{name} of mode {mode}")
        return self._further[mode, name](*data)[0]

    def expressions(self, mode: int, data: Sequence[Number]) -> tuple[tuple[str, Routine], ...]:
        """Return a mode's expressions one by one, named for a person."""
        program = self._program.flows[mode]
        functions = compile_routines(program.diagnosis, self.arithmetic, f"expressions of mode {mode}")(*data)
        return tuple(zip(program.expressions, functions, strict=True))


def changed(routine: Routine, edge: EdgeProgram, first: int) -> Routine:
    """Put what an edge changes in its place among the values that its target's states have as arguments."""
    count = len(edge.target_states)
    if len(edge.changes) == count:
        return routine

    def whole(*arguments: Number) -> Vector:
        found = list(arguments[first : first + count])
        for place, value in zip(edge.changes, routine(*arguments), strict=True):
            found[place] = value
        return tuple(found)

    return whole


def spread_out(routine: Routine, places: Sequence[int], size: int, zero: Number) -> Routine:
    """Put a routine's values in their places among zeros."""
    if len(places) == size:
        return routine

    def spread(*arguments: Number) -> Vector:
        whole = [zero] * size
        for place, value in zip(places, routine(*arguments), strict=True):
            whole[place] = value
        return tuple(whole)

    return spread


PLAIN = ("flow", "surfaces", "magnitudes")
UNITS_BESIDE = (2, 8, 32)


def beside(routine: Routine, unit: Number) -> Routine:
    """A routine that has its value a few units of round-off of time away where it has none.

    At an end of a segment of inputs, rounding may give a root the wrong side of zero.
    """

    def evaluate(t: Number, *x: Number) -> Vector:
        try:
            return routine(t, *x)
        except DOMAIN_ERRORS as error:
            for units in UNITS_BESIDE:
                for near in (t + units * unit * abs(t), t - units * unit * abs(t)):
                    with suppress(*DOMAIN_ERRORS):
                        return routine(near, *x)
            raise error

    return evaluate


def conjunction(parts: Sequence[Callable[..., tuple[bool, ...]]]) -> Callable[..., tuple[bool, ...]]:
    """Make `and` of parts: one that is false decides, even if another has no value."""
    if len(parts) == 1:
        return parts[0]

    def holds(*arguments: Number) -> tuple[bool, ...]:
        without_value: Exception | None = None
        for part in parts:
            try:
                if not part(*arguments)[0]:
                    return (False,)
            except DOMAIN_ERRORS as error:
                without_value = error
        if without_value is not None:
            raise without_value
        return (True,)

    return holds


LOST = (*DOMAIN_ERRORS, UnboundLocalError)  # no value, also where a name is used whose statement had none
_CONSTANT = re.compile(r"\bq_(m?)(\d+)_(\d+)\b")
_DEFINITION = re.compile(r"^    def \w+\(", re.MULTILINE)


def compile_routines(routines: Routines, arithmetic: Arithmetic, name: str) -> Callable[..., tuple[Routine, ...]]:
    """Compile generated text; returns its ``bind``.

    Floats are written into the text as literals (the interpreter is fastest on those); other numbers are names. Each
    routine is put into a list as it is made: Python compiles n functions with names of their own in n**2 steps.
    """
    namespace: dict[str, Any] = {"__builtins__": {}, "inf": float("inf"), "LOST": LOST, **arithmetic.functions}
    literal = arithmetic.name == "float64"

    def replace(match: re.Match[str]) -> str:
        value = arithmetic.constant(Fraction(int(match[2]) * (-1 if match[1] else 1), int(match[3])))
        if literal:
            return f"({value!r})" if match[1] else repr(value)
        namespace[match[0]] = value
        return match[0]

    head, text = routines.source.split("\n", 1)
    inner = _DEFINITION.sub("    @made.append\n    def routine(", text[: text.rindex("    return ")])
    source = f"{head}\n    made = []\n{_CONSTANT.sub(replace, inner)}    return (*made,)\n"
    exec(compile(source, f"<hsdsl {name}>", "exec"), namespace)
    return namespace["bind"]


def each_apart(routines: Routines, name: str) -> Routines:
    """One of the routines, so that a value that there is none of is not-a-number, and the others are what they are."""
    bind = ast.parse(routines.source).body[0]
    assert isinstance(bind, ast.FunctionDef)
    routine = next(part for part in bind.body if isinstance(part, ast.FunctionDef) and part.name == name)
    *statements, last = routine.body
    assert isinstance(last, ast.Return) and isinstance(last.value, ast.Tuple)
    results = [f"result_{k}" for k in range(len(last.value.elts))]
    lines = [_tried(ast.unparse(statement), "pass") for statement in statements]
    for result, value in zip(results, last.value.elts, strict=True):
        lines.append(_tried(f"{result} = {ast.unparse(value)}", f"{result} = nan"))
    body = "".join([*lines, f"return ({''.join(f'{result}, ' for result in results)})\n"])
    function = f"def {name}({ast.unparse(routine.args)}):\n{indent(body, '    ')}return ({name},)\n"
    return Routines((name,), f"def bind({ast.unparse(bind.args)}):\n{indent(function, '    ')}")


def _tried(statement: str, otherwise: str) -> str:
    return f"try:\n    {statement}\nexcept LOST:\n    {otherwise}\n"
