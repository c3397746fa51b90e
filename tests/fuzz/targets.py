"""What must hold for every input: an answer or a refusal of ours, no code run, nothing touched, names mangled."""

from __future__ import annotations

import builtins
import re
import signal
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from random import Random
from typing import Any

import yaml

from fuzz import late, seeds
from hsdsl.base import limits
from hsdsl.base.errors import ModelError, UsageError
from hsdsl.base.functions import replaced
from hsdsl.engine.backends.c.source import _HEAD, model_source
from hsdsl.interface.model import Model
from hsdsl.language.diagnose import as_json, render
from hsdsl.language.elaborate import elaborate
from hsdsl.language.expression import ExpressionError, parse, symbolic
from hsdsl.language.expression.conditions import inequality
from hsdsl.language.expression.scope import Scope, Value, state, symbol
from hsdsl.language.expression.timebox import PARTS, OutOfTime, deep_stack, timebox
from hsdsl.language.system import TIME
from hsdsl.mathematics.lower.straight import Definition, Gradient, print_routines

assert late.LATE  # before anything is watched
SCOPE = Scope(
    {
        **{name: state(name) for name in ("x", "v", "y", "u")},
        **{name: Value(symbol(name)) for name in ("a", "c", "k")},
        "t": Value(TIME),
    }
)
# all that generated text may consist of, besides numbers and punctuation
_GENERATED = re.compile(
    r"def|return|bind|given|and|or|not|True|False|nan|pi|e|t|heaviside|pow|inf"
    r"|flow|surfaces|magnitudes|outputs|(?:gradient|rate|reset|spread|expression|parameter|minimum|maximum|input)_\d+"
    r"|condition_\d+_\d+|initial|until|step|tolerance|relaxation|max_transitions|sample_times|sample_count"
    r"|[xpabcsvwgke]\d+|q_m?\d+_\d+"
    r"|sin|cos|tan|asin|acos|atan|atan2|sinh|cosh|tanh|asinh|acosh|atanh|exp|log|sqrt|abs|sign|floor|min|max"
)
_GENERATED_C = re.compile(
    r"Generated|from|a|model|see|h|for|what|the|tables|mean|include|static|extern|const|restrict|int|double|void|return"
    r"|[ptx]|out|bad|hs|hs_\w+|HS_\w+|(?:routine|routines|edges|modes|walls|inputs|state|[a-z])_?\d+(?:_\d+)?|NAN|INFINITY"
    r"|(?:series|surface_series|flow_lines|surface_lines|surface_line|line|jacobian|gradients)_\d+"
    r"|(?:places|pattern|elimination|locals|of)_\d+|lines_\d+(?:_(?:values|states|coefficients)_\d+)?|number|of|v|i|place|order|lines|length|size_t|[ck]|for|if|else"
)
_HEXADECIMAL = re.compile(r"\b0x[0-9a-f.]+p[-+]\d+")
_WORD = re.compile(r"[^\W\d]\w*")
_PLAIN = b"""hsdsl: 1
modes: {m: {flow: {x: 1}}}
initial: {mode: m, x: 0}
experiment: {until: 1}
"""
_OF_PARTS = b"""hsdsl: 1
automata: {A: {modes: {m: {flow: {x: 1}}}}}
system: {a: {automaton: A, initial: {mode: m, x: 0}}}
experiment: {until: 1}
"""
_FORBIDDEN = ("os.", "subprocess.", "socket.", "shutil.", "ctypes.", "urllib.", "ftplib.", "pty.", "pickle.")


class Violation(Exception):
    """Something happened that no model may cause."""


class Guard:
    """An audit hook: while `watching`, files of the folder may be read, and nothing else may happen."""

    def __init__(self, folder: Path) -> None:
        self.folder = str(folder.resolve())
        self.watching = False
        self.seen: list[str] = []
        libraries = str(Path(yaml.__file__).parents[1])
        self._readable = (self.folder, libraries, sys.prefix, sys.base_prefix, str(seeds.TESTS.parent / "hsdsl"))
        for text in (_PLAIN, _OF_PARTS):  # annotations of documents are evaluated where they are first used
            elaborate("model.yaml", text=text)
        sys.addaudithook(self._hook)

    def _hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.watching:
            return
        if event == "open":
            self._opened(*arguments)
        elif event == "compile":
            self._compiled(*arguments)
        elif event.startswith(_FORBIDDEN) and event not in ("os.listdir", "os.scandir"):
            self.seen.append(f"{event} {arguments!r:.200}")

    def _opened(self, path: Any, mode: Any, flags: int) -> None:
        import os

        if isinstance(path, int):
            return
        real = os.path.realpath(os.fsdecode(path))
        if flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT) or not real.startswith(self._readable):
            self.seen.append(f"open {real} {mode}")

    def _compiled(self, source: Any, filename: Any) -> None:
        ours = str(filename).startswith(("<hsdsl", *self._readable[1:]))  # generated, or a module imported just now
        ours = ours or (isinstance(source, bytes) and source.startswith(b"def routine("))
        if source and not ours:  # an empty text does nothing
            self.seen.append(f"compile {source!r:.200} of {filename}")

    @contextmanager
    def watch(self) -> Generator[None]:
        """Raise what was seen; also where a payload has left its mark."""
        self.seen.clear()
        keeps = sys.dont_write_bytecode
        self.watching = sys.dont_write_bytecode = True  # what is imported here for the first time is not the input's
        try:
            yield
        finally:
            self.watching, sys.dont_write_bytecode = False, keeps
        if (Path(self.folder) / seeds.CANARY).exists() or hasattr(builtins, seeds.CANARY):
            self.seen.append("the payload ran")
        if self.seen:
            raise Violation("; ".join(self.seen[:5]))


def prepared(folder: Path) -> Path:
    """A folder as models lie in: data files good and bad, a way out of it, and something outside."""
    inside = folder / "model"
    inside.mkdir(parents=True, exist_ok=True)
    (inside / "u.csv").write_text("time,u\n0,1\n0.5,-1\n1,2e300\n")
    (inside / "empty.csv").write_text("")
    (inside / "binary.csv").write_bytes(bytes(range(256)) * 4)
    (folder / "secret.csv").write_text("time,u\n0,1\n")
    for link, target in (("link.csv", folder / "secret.csv"), ("outside", folder)):
        if not (inside / link).is_symlink():
            (inside / link).symlink_to(target)
    return inside


def feed(kind: str, data: str | bytes, rng: Random, folder: Path, share: float = 0.15) -> str:
    """One input through what reads it; the answer is how far it got.

    Raises Exception: anything but the refusals of the house: a defect.
    """
    if kind == "expressions":
        return feed_expression(str(data), rng, share)
    return feed_document(data if isinstance(data, bytes) else data.encode(), rng, folder, share)


def feed_expression(text: str, rng: Random, share: float) -> str:
    """One expression, as a number, a condition and an inequality."""
    got = "refused"
    for expected in ("number", "condition", "inequality"):
        try:
            tree = parse(text, expected)  # pyright: ignore[reportArgumentType]
            if SCOPE.faults(tree):
                continue
            with deep_stack(), timebox(limits.DEFAULT.seconds, PARTS):
                if expected == "number":
                    found = [symbolic.number(tree, SCOPE, text).expr]
                elif expected == "inequality":
                    left, _, right = inequality(tree, SCOPE, text, "when")
                    found = [left.expr, right.expr]
                else:
                    symbolic.condition(tree, SCOPE, text)
                    continue
                got = "read"
                if rng.random() < share:
                    _lowered(found)
                    got = "lowered"
        except OutOfTime:
            got = "out of time"
        except ExpressionError as error:
            if not (0 <= error.start < error.end <= max(1, len(text) + 1) and error.message):
                raise Violation(f"{error.code} at {error.start}:{error.end}: {error.message}") from error
    return got


def _lowered(found: list[Any]) -> None:
    names = dict(zip(map(symbol, ("x", "v", "y", "u", "a", "c", "k")), map(symbol, _MANGLED), strict=True))
    exprs = [replaced(expr, names, {}) for expr in found]
    arguments = [TIME, *(symbol(f"x{i}") for i in range(4))]
    gradient = Gradient(exprs, arguments)
    every = (*exprs, *(d for row in gradient.rows for d in row))
    check_text(print_routines([Definition("flow", tuple(arguments), every, gradient.statements)], ()).source)


_MANGLED = ("x0", "x1", "x2", "x3", "p0", "p1", "p2")


def feed_document(data: bytes, rng: Random, folder: Path, share: float) -> str:
    """One file: read, a share of them lowered, and a share of those run for a moment."""
    path = str(folder / "m.yaml")
    try:
        model = Model(elaborate(path, text=data))
    except ModelError as error:
        for diagnostic in error.diagnostics:
            _check_said(render(diagnostic))
        if not error.diagnostics:
            raise Violation("refused without a word") from error
        as_json(error.diagnostics)
        return "refused"
    if rng.random() >= share:
        return "read"
    program = model.program
    for routines in (program.constants, *(r for mode in program.modes for r in (mode.routines, mode.diagnosis))):
        check_text(routines.source)
    check_c(model_source(program))
    try:
        with interrupted_after(0.1):
            model.simulate(max_transitions=20, engine="python")
    except (ModelError, UsageError, KeyboardInterrupt):
        return "lowered"
    return "run"


def check_text(source: str) -> None:
    """Refuse generated text with a word in it that is not ours."""
    for word in set(_WORD.findall(source)):
        if not _GENERATED.fullmatch(word):
            raise Violation(f"the name {word!r} stands in generated text")


def check_c(source: str) -> None:
    """Refuse generated C with a word in it that is not ours."""
    for word in set(_WORD.findall(_HEXADECIMAL.sub("", source.replace(_HEAD, "")))):
        if not _GENERATED_C.fullmatch(word):
            raise Violation(f"the name {word!r} stands in generated C")


def _check_said(text: str) -> None:
    for jargon in ("sympy", "pydantic", "Traceback", " object at 0x", "\x1b"):
        if jargon in text.split("\n")[0]:
            raise Violation(f"{jargon!r} is printed: {text[:300]}")


@contextmanager
def interrupted_after(seconds: float) -> Generator[None]:
    """Ctrl-C after some processor time."""
    before = signal.signal(signal.SIGPROF, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
