"""The text of the scheme as C99: the same operations in the same order, each with its own parentheses.

The text is Python, and a small part of it: `docs/scheme.md` defines which. Modules of this folder are read by Python's
parser; anything outside the subset is refused, with file and line. The first assignment to a name fixes its kind, its
type in C: a number, an instant, an integer, a truth, a vector, or a record. In C a function whose result may be absent
returns whether it has one, and one that may fail whether it has failed; their results go to pointers.

`Scheme` collects the records and signatures of all modules; `_Function` prints one function. What prints an expression
returns its text in C and its kind.
"""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import takewhile
from pathlib import Path
from textwrap import fill, indent

from hsdsl.engine.backends.printer import C_OPERATORS

FOLDER = Path(__file__).parent
ROOT = FOLDER.parents[2]
BY_HAND = "primitives"  # the text whose C is `primitives.h`
# in the order in which they build on each other
TEXTS = ("control", "pace", "polynomials", "roots", "linear", "scales", "newton", "radau")
PLAIN = {"Number": "hs_real", "Time": "hs_time", "int": "int", "bool": "int", "Count": "int64_t"}
VECTORS = {
    "Here": "hs_run *", "Room": "hs_real *", "Vector": "const hs_real *", "list[Room]": "hs_real **",
    "IndexRoom": "int *", "Indices": "const int *", "list[int]": "const int *", "Sequence[Vector]": "",
}  # fmt: skip
ELEMENTS = {
    "Room": "Number", "Vector": "Number", "list[Room]": "Room", "Sequence[Vector]": "Vector",
    "IndexRoom": "int", "Indices": "int", "list[int]": "int",
}  # fmt: skip
GIVEN = {"TIE": "HS_TIE", "NOTHING": "HS_NOTHING"}  # constants that differ by the type of numbers
CALLS = {"abs": "fabs", "sqrt": "sqrt"}
FOLDED = {"min": "hs_min", "max": "hs_max"}
SIGNS: Mapping[type[ast.AST], str] = {**C_OPERATORS, ast.Div: "/", ast.Is: "==", ast.IsNot: "!=", ast.BitOr: "|"}
WHOLE: Mapping[type[ast.AST], str] = {ast.FloorDiv: "/", ast.Mod: "%"}  # of what is not negative
MAY_BE_NONE = " | None"
NO_ARGUMENTS = ("posonlyargs", "vararg", "kwonlyargs", "kwarg", "defaults")


class Refused(ValueError):
    """The text is not of the subset."""


@dataclass(frozen=True)
class Signature:
    """What a caller knows of a function; ``results`` are kinds, ``optional`` says whether they may be absent."""

    arguments: Mapping[str, str]
    results: Sequence[str]
    optional: bool
    fails: bool

    @property
    def status(self) -> bool:
        """Whether its result in C is a status."""
        return self.optional or self.fails


@dataclass(frozen=True)
class Text:
    """A module of the text."""

    name: str
    tree: ast.Module
    comments: Mapping[int, str]

    @classmethod
    def of(cls, name: str, source: str) -> Text:
        """Read it."""
        tokens = tokenize.generate_tokens(io.StringIO(source).readline)
        comments = {token.start[0]: token.string.lstrip("# ") for token in tokens if token.type == tokenize.COMMENT}
        return cls(name, ast.parse(source), comments)

    def refused(self, node: ast.AST, what: str = "this") -> Refused:
        """Say that a node is not of the subset."""
        line = getattr(node, "lineno", 0)
        return Refused(f"{self.name}.py:{line}: expected the subset of docs/scheme.md, got {what}: {ast.unparse(node)}")

    def of_kind(self, kind: type[ast.AST]) -> list[ast.AST]:
        """Its statements of a kind."""
        return [part for part in self.tree.body if isinstance(part, kind)]


class Scheme:
    """All texts: their records and signatures."""

    def __init__(self, texts: Sequence[Text]) -> None:
        self.texts = texts
        self.records: dict[str, dict[str, str]] = {}
        self.values = set[str]()  # records that are passed by value: nothing changes them
        self.given = set[str]()  # records that C has in its headers
        self.functions: dict[str, Signature] = {}
        self.constants: dict[str, str] = {}
        for text in texts:
            for part in text.tree.body:
                if isinstance(part, ast.ImportFrom) and part.module not in (None, "dataclasses"):
                    self._import(part)
                self._declare(text, part)

    def _import(self, part: ast.ImportFrom) -> None:
        """Declare the records of another module, which C has in its headers."""
        source = ROOT.joinpath(*(part.module or "").split(".")).with_suffix(".py")
        if ROOT / "hsdsl" / "base" not in source.parents:
            return
        wanted = {each.name for each in part.names}
        for each in ast.parse(source.read_text()).body:
            if isinstance(each, ast.ClassDef) and each.name in wanted and each.decorator_list:
                self.given.add(each.name)
                self._declare(Text(source.stem, ast.Module([], []), {}), each)

    def _declare(self, text: Text, part: ast.stmt) -> None:
        match part:
            case ast.ClassDef(name=name, body=body):
                fields = [each for each in body if isinstance(each, ast.AnnAssign)]
                kinds = {ast.unparse(each.target): _kind(each.annotation) for each in fields}
                for each, kind in zip(fields, kinds.values(), strict=True):
                    if kind not in PLAIN and kind not in VECTORS and _of_list(kind) not in self.records:
                        raise text.refused(each, "a field")
                self.records[name] = kinds
                if text.name == BY_HAND:
                    self.given.add(name)
                elif name not in self.given and "frozen=True" in ast.unparse(part.decorator_list[0]):
                    self.values.add(name)
            case ast.FunctionDef(name=name, args=arguments, returns=returns):
                if name in self.functions:
                    raise text.refused(part, "a second function of this name")
                if any(vars(arguments)[each] for each in NO_ARGUMENTS) or {*_decorators(part)} - {"inline", "may_fail"}:
                    raise text.refused(part, "a function with other arguments or decorators")
                result = "None" if returns is None else ast.unparse(returns)
                given = {one.arg: _kind(one.annotation) for one in arguments.args if one.annotation is not None}
                optional, result = result.endswith(MAY_BE_NONE), result.removesuffix(MAY_BE_NONE)
                results = result.removeprefix("tuple[").removesuffix("]").split(", ") if result != "None" else []
                self.functions[name] = Signature(given, results, optional, "may_fail" in _decorators(part))
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                self.constants[name] = (
                    "int" if isinstance(value, ast.Constant) and type(value.value) is int else "Number"
                )
            case ast.Import() | ast.ImportFrom() | ast.Expr(value=ast.Constant()):
                pass
            case _:
                raise text.refused(part)

    def c_type(self, kind: str) -> str:
        """A kind in C, as it is passed."""
        if kind in PLAIN:
            return f"{PLAIN[kind]} "
        if kind in VECTORS:
            return VECTORS[kind]
        name = f"hs_{_of_list(kind).lower()} "
        return name if kind in self.values else f"const {name}*" if kind in self.given else f"{name}*"

    def field_type(self, kind: str) -> str:
        """The same as a field: a record is part of the one that has it."""
        return f"hs_{kind.lower()} " if self.is_part(kind) else self.c_type(kind)

    def is_part(self, kind: str) -> bool:
        """Whether a field is a record of its own, not an address."""
        return kind in self.records and kind not in self.given

    def header(self) -> str:
        """The records of all texts as C."""
        parts: list[str] = []
        for text in self.texts:
            for part in text.of_kind(ast.ClassDef):
                assert isinstance(part, ast.ClassDef)
                if part.name in self.given:
                    continue
                fields = (f"  {self.field_type(kind)}{name};\n" for name, kind in self.records[part.name].items())
                about = _comment(ast.get_docstring(part) or "", f"{text.name}.py:{part.lineno}")
                parts.append(f"{about}typedef struct {{\n{''.join(fields)}}} hs_{part.name.lower()};\n")
        return "\n".join(parts)

    def module(self, text: Text) -> str:
        """A text's constants and functions as C."""
        parts = [_comment(ast.get_docstring(text.tree) or "", f"printed from hsdsl/engine/scheme/{text.name}.py")]
        for part in text.tree.body:
            if isinstance(part, ast.Assign):
                printed = _Function(self, text, {}).value(part.value)[0]
                parts.append(f"#define {ast.unparse(part.targets[0])} {printed}\n")
            if isinstance(part, ast.FunctionDef):
                parts.append(_Function(self, text, self.functions[part.name].arguments).printed(part))
        return "\n".join(parts).replace("\n\n#define", "\n#define")

    def head(self, name: str, inline: bool) -> str:
        """How a function begins in C."""
        known = self.functions[name]
        given = [f"{self.c_type(kind)}{argument}" for argument, kind in known.arguments.items()]
        first = 0 if known.status else 1
        out = [f"{self.c_type(kind)}*result{k or ''}" for k, kind in enumerate(known.results) if k >= first]
        returned = "int " if known.status else self.c_type(known.results[0]) if known.results else "void "
        return f"{'HS_INLINE' if inline else 'static'} {returned}{name}({', '.join(given + out)})"


class _Function:
    """One function: the kinds of its names, and where they are declared."""

    def __init__(self, scheme: Scheme, text: Text, arguments: Mapping[str, str]) -> None:
        self.scheme, self.text = scheme, text
        self.kinds = dict(arguments)  # of all names set so far
        self.optional = set[str]()  # names whose value may be absent
        self.late: dict[str, str] = {}  # names by kind that C declares at the function's beginning
        self.innermost: dict[str, tuple[int, ...]] = {}  # for each name the path to the block that has all its uses
        self.known = Signature({}, (), False, False)
        self.failed = ""  # the statement in C where a call has failed
        self.before = set[str]()  # functions that stand before this one
        self.commented = 0  # line of the last comment

    def printed(self, definition: ast.FunctionDef) -> str:
        """Print it."""
        self.known, self.commented = self.scheme.functions[definition.name], definition.lineno
        self.before = {*takewhile(lambda name: name != definition.name, self.scheme.functions)}
        if self.known.fails:
            self.failed = "return RAISED;"
        self._find_innermost(definition.body, ())
        body = [part for part in definition.body if not _is_docstring(part)]
        lines = self.block(body, ())
        if (self.known.fails and not self.known.results) or (
            self.known.optional and not isinstance(body[-1], ast.Return)
        ):
            lines.append("return 0;")
        declared = [f"{self.scheme.c_type(kind)}{name};" for name, kind in self.late.items()]
        about = _comment(ast.get_docstring(definition) or "", f"{self.text.name}.py:{definition.lineno}")
        text = indent("\n".join([*declared, *lines]), "  ")
        return f"{about}{self.scheme.head(definition.name, 'inline' in _decorators(definition))} {{\n{text}\n}}\n"

    def _find_innermost(self, body: Sequence[ast.stmt], path: tuple[int, ...]) -> None:
        """Find for each name the innermost block that has all its uses."""
        for part in body:
            inner = [getattr(part, name) for name in ("body", "orelse") if isinstance(getattr(part, name, None), list)]
            within = {id(node) for block in inner for statement in block for node in ast.walk(statement)}
            for node in ast.walk(part):
                if isinstance(node, ast.Name) and id(node) not in within:
                    before = self.innermost.get(node.id, path)
                    shared = [a for a, b in zip(before, path, strict=False) if a == b]
                    self.innermost[node.id] = tuple(shared)
            for block in inner:
                self._find_innermost(block, (*path, id(block)))

    def block(self, body: Sequence[ast.stmt], path: tuple[int, ...]) -> list[str]:
        """Print statements, with the comments before them and beside them."""
        lines: list[str] = []
        for part in body:
            first = getattr(part, "value", part)
            lines += [
                f"/* {self.text.comments[k]} */"
                for k in range(self.commented + 1, part.lineno)
                if k in self.text.comments
            ]
            beside = self.text.comments.get(part.lineno)
            self.commented = part.lineno
            printed = self.statement(part, path)
            if beside:
                printed[0] += f" /* {beside} */"
            lines += printed
            self.commented = max(self.commented, getattr(first, "end_lineno", part.lineno))
        return lines

    def statement(self, part: ast.stmt, path: tuple[int, ...]) -> list[str]:
        """Print one statement."""
        match part:
            case ast.Assign(targets=[target], value=value):
                return self.assignment(part, target, value, None, path)
            case ast.AnnAssign(target=target, annotation=annotation, value=ast.expr() as value):
                return self.assignment(part, target, value, ast.unparse(annotation), path)
            case ast.AugAssign(target=target, op=operator, value=value) if type(operator) in SIGNS:
                place, kind = self.value(target)
                kind = "bool" if isinstance(operator, ast.BitOr) else kind  # of integers it would join bits
                self.fits(part, kind, self.operation(part, target, operator, value)[1])
                return [f"{place} {SIGNS[type(operator)]}= {self.value(value, outer=True)[0]};"]
            case ast.If(test=test, body=body, orelse=other):
                lines = [f"if ({self.truth(test)}) {{", *self.inner(body, path)]
                if other:
                    lines += ["} else {", *self.inner(other, path)]
                return [*lines, "}"]
            case ast.While(test=test, body=body, orelse=[]):
                return [f"while ({self.truth(test)}) {{", *self.inner(body, path), "}"]
            case ast.For(
                target=ast.Name(id=name), iter=ast.Call(func=ast.Name(id="range"), args=bounds), body=body, orelse=[]
            ):
                return [self.loop(part, name, bounds, body), *self.inner(body, path), "}"]
            case ast.For(
                target=ast.Name(id=name), iter=ast.Call(func=ast.Name(id="each"), args=bounds), body=body, orelse=[]
            ):
                return ["HS_SIMD", self.loop(part, name, bounds, body), *self.inner(body, path), "}"]
            case ast.Return(value=value):
                return self.returned(part, value)
            case ast.Break() | ast.Continue():
                return [f"{ast.unparse(part)};"]
            case ast.Try(
                body=body,
                handlers=[ast.ExceptHandler(type=ast.Name(id="DOMAIN_ERRORS"), body=[last])],
                orelse=[],
                finalbody=[],
            ):
                (handled,) = self.statement(last, path)
                before, self.failed = self.failed, handled
                lines = self.block(body, path)
                self.failed = before
                return lines
            case ast.Expr(value=ast.Call() as call):
                return [self.call_statement(call, [])]
            case _:
                raise self.text.refused(part, "the statement")

    def inner(self, body: Sequence[ast.stmt], path: tuple[int, ...]) -> list[str]:
        """Print a block within a statement."""
        return [f"  {line}" for line in self.block(body, (*path, id(body)))]

    def loop(self, part: ast.stmt, name: str, bounds: Sequence[ast.expr], body: Sequence[ast.stmt]) -> str:
        """Print the head of a loop; the variable and the names in its bounds must stay what they are."""
        start, stop, step = (
            [ast.Constant(0), *bounds, ast.Constant(1)] if len(bounds) == 1 else [*bounds, ast.Constant(1)][:3]
        )
        set_inside = {place for one in body for place in _places(one, ast.Store)}
        if set_inside & {name, *(place for bound in bounds for place in _places(bound, ast.Load))}:
            raise self.text.refused(part, "a loop whose variable or bounds change")
        self.kinds[name] = "int"
        if not ast.unparse(step).lstrip("-").isdigit():
            raise self.text.refused(part, "a loop whose step is no number")
        by = int(ast.unparse(step))
        sign, how = ("<", "++" if by == 1 else f" += {by}") if by > 0 else (">", "--" if by == -1 else f" -= {-by}")
        return f"for (int {name} = {self.value(start)[0]}; {name} {sign} {self.value(stop)[0]}; {name}{how}) {{"

    def returned(self, part: ast.stmt, value: ast.expr | None) -> list[str]:
        """Print a return: of one result, of several, or of none."""
        known = self.known
        if value is None:
            return ["return 0;" if known.fails else "return;"]
        if known.optional and isinstance(value, ast.Constant) and value.value is None:
            return ["return 0;"]
        values = value.elts if isinstance(value, ast.Tuple) else [value]
        if len(values) != len(known.results):
            raise self.text.refused(part, f"{len(values)} results in place of {len(known.results)}")
        if known.optional and isinstance(value, ast.Call) and self.signature(value).optional:
            return [f"return {self.call(value, ['result'])};"]
        found = [self.value(each, outer=True) for each in values]
        for kind, (_, one) in zip(known.results, found, strict=True):
            self.fits(part, kind, one)
        texts = [text for text, _ in found]
        first = 0 if known.status else 1
        lines = [f"*result{k or ''} = {text};" for k, text in enumerate(texts) if k >= first]
        if known.optional and isinstance(value, ast.Name) and value.id in self.optional:
            return [*lines, f"return has_{value.id};"]
        return [*lines, "return 1;" if known.optional else "return 0;" if known.fails else f"return {texts[0]};"]

    def assignment(
        self, part: ast.stmt, target: ast.expr, value: ast.expr, kind: str | None, path: tuple[int, ...]
    ) -> list[str]:
        """Print an assignment: of one value, of each to each, or of what a call gives."""
        targets = target.elts if isinstance(target, ast.Tuple) else [target]
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            read = {place for one in value.elts[1:] for place in _places(one, ast.Load)}
            if read & _places(target, ast.Store):
                raise self.text.refused(part, "values that are set before they are read")
            pairs = zip(targets, value.elts, strict=True)
            return [line for one, given in pairs for line in self.assignment(part, one, given, None, path)]
        if isinstance(value, ast.Call) and (known := self.known_call(value)) and (known.status or len(targets) > 1):
            lines: list[str] = []
            for one, result in zip(targets, known.results, strict=True):
                if isinstance(one, ast.Name) and self.new(one.id, result, path):
                    lines.append(f"{self.scheme.c_type(result)}{one.id};")
                if isinstance(one, ast.Name) and known.optional:
                    self.optional.add(one.id)
            return [*lines, *self.assigned_call(value, known, targets, path)]
        if isinstance(value, ast.Constant) and value.value is None and isinstance(target, ast.Name):
            return [f"has_{target.id} = 0;"]
        text, found = self.value(value, outer=True)
        declared = isinstance(target, ast.Name) and self.new(target.id, kind or found, path)
        place, known = self.value(target)
        self.fits(part, known, found)
        if not isinstance(target, ast.Name):
            return [f"{place} = {text};"]
        lines = [f"has_{target.id} = 1;"] if target.id in self.optional else []
        return [f"{self.scheme.c_type(self.kinds[target.id]) if declared else ''}{target.id} = {text};", *lines]

    def fits(self, part: ast.stmt, kind: str, found: str) -> None:
        """Refuse a value that a name or a place of another kind cannot have: Python would change what it is."""
        narrower = kind in ("int", "Count", "bool") and _wider(kind, found) != kind
        if narrower or (kind in PLAIN) != (found in PLAIN) or (kind in VECTORS) != (found in VECTORS):
            raise self.text.refused(part, f"{kind} that is set to {found}")

    def assigned_call(
        self, call: ast.Call, known: Signature, targets: Sequence[ast.expr], path: tuple[int, ...]
    ) -> list[str]:
        """Print an assignment from a call that may fail, may have no result, or has several."""
        texts = [self.value(one)[0] for one in targets]
        if known.fails:
            return [self.call_statement(call, texts)]
        if not known.optional:
            return [f"{texts[0]} = {self.call(call, texts[1:])};"]
        name = texts[0]
        place = self.new(f"has_{name}", "bool", path, self.innermost.get(name, ()))
        return [f"{'int ' if place else ''}has_{name} = {self.call(call, texts)};"]

    def new(self, name: str, kind: str, path: tuple[int, ...], within: tuple[int, ...] | None = None) -> bool:
        """Fix the kind of a new name; return whether C declares it in the statement that sets it first."""
        if name in self.kinds:
            return False
        self.kinds[name] = kind
        place = self.innermost.get(name, ()) if within is None else within
        if place == path:
            return True
        self.late[name] = kind
        return False

    def known_call(self, call: ast.Call) -> Signature | None:
        """The signature of what is called, if it is a function that stands before."""
        name = ast.unparse(call.func)
        return self.scheme.functions[name] if name in self.before else None

    def signature(self, call: ast.Call) -> Signature:
        """The signature of a function that stands before: none calls itself."""
        if (known := self.known_call(call)) is None:
            raise self.text.refused(call, "the call")
        return known

    def call(self, call: ast.Call, out: Sequence[str]) -> str:
        """Print a call, its further results going to ``out``."""
        known = self.signature(call)
        if len(call.args) != len(known.arguments) or call.keywords:
            raise self.text.refused(call, "a call with other arguments")
        given = [self.value(argument, outer=True)[0] for argument in call.args]
        given += [one if one == "result" else f"&{one}" for one in out]
        return f"{ast.unparse(call.func)}({', '.join(given)})"

    def call_statement(self, call: ast.Call, out: Sequence[str]) -> str:
        """Print a call as a statement, with what happens where it fails."""
        if not self.signature(call).fails:
            return f"{self.call(call, out)};"
        if not self.failed:
            raise self.text.refused(call, "a call that may fail, outside of try")
        return f"if ({self.call(call, out)}) {self.failed}"

    def truth(self, node: ast.expr, outer: bool = True) -> str:
        """Print a condition."""
        text, kind = self.value(node, outer)
        if kind != "bool":
            raise self.text.refused(node, f"a condition that is {kind}")
        return text

    def value(self, node: ast.expr, outer: bool = False) -> tuple[str, str]:
        """Print an expression, and find its kind; the outermost one needs no parentheses."""
        text, kind = self.bare(node)
        nested = isinstance(node, (ast.BinOp, ast.BoolOp, ast.Compare, ast.IfExp))
        return (f"({text})" if nested and not outer else text), kind

    def bare(self, node: ast.expr) -> tuple[str, str]:
        """Print an expression without parentheses around it."""
        match node:
            case ast.Constant(value=bool() | int() | float() as value):
                text = f"((hs_real){value!r})" if isinstance(value, float) else str(int(value))
                return text, {bool: "bool", int: "int", float: "Number"}[type(value)]
            case ast.Name(id=name):
                return self.name(node, name)
            case ast.UnaryOp(op=ast.Not() | ast.USub() as operator, operand=operand):
                text, kind = self.value(operand)
                if isinstance(operator, ast.Not):
                    return f"!{self.truth(operand, outer=False)}", "bool"
                return f"-{text}", kind
            case ast.Attribute() | ast.Subscript():
                return self.part(node)
            case _:
                return self.compound(node)

    def part(self, node: ast.Attribute | ast.Subscript) -> tuple[str, str]:
        """Print a part of a record or of a vector."""
        match node:
            case ast.Attribute(value=value, attr=field):
                text, kind = self.value(value)
                if field not in self.scheme.records.get(kind, {}):
                    raise self.text.refused(node, f"a field of {kind}")
                found = self.scheme.records[kind][field]
                address = "&" if self.scheme.is_part(found) and found not in self.scheme.values else ""
                dot = "." if text[0] == "&" or kind in self.scheme.values else "->"
                return f"{address}{text.lstrip('&')}{dot}{field}", found
            case ast.Subscript(value=value, slice=ast.Slice(lower=ast.expr() as first, upper=None, step=None)):
                return f"{self.value(value)[0]} + {self.value(first)[0]}", "Vector"
            case ast.Subscript(value=value, slice=index):
                text, kind = self.value(value)
                at = f"{text}[{self.value(index, outer=True)[0]}]"
                return (at, ELEMENTS[kind]) if kind in ELEMENTS else (f"&{at}", _of_list(kind))

    def compound(self, node: ast.expr) -> tuple[str, str]:
        """Print an operation, or a call."""
        match node:
            case ast.BinOp(left=left, op=operator, right=right):
                return self.operation(node, left, operator, right)
            case ast.BoolOp(op=operator, values=values):
                sign = " && " if isinstance(operator, ast.And) else " || "
                return sign.join(self.truth(one, outer=False) for one in values), "bool"
            case ast.Compare(left=left, ops=operators, comparators=others):
                return self.comparison(node, left, operators, others), "bool"
            case ast.IfExp(test=test, body=body, orelse=other):
                (one, kind), (two, another) = self.value(body), self.value(other)
                return f"{self.truth(test, outer=False)} ? {one} : {two}", _wider(kind, another)
            case ast.Call(func=ast.Name(id=name), args=arguments) if name in FOLDED or name in CALLS:
                return self.folded(name, arguments)
            case ast.Call():
                known = self.signature(node)
                if known.status or len(known.results) != 1:
                    raise self.text.refused(node, "a call inside an expression that may have no value, or several")
                return self.call(node, []), known.results[0]
            case _:
                raise self.text.refused(node, "the expression")

    def name(self, node: ast.expr, name: str) -> tuple[str, str]:
        """Print a name."""
        if name in self.kinds:
            return name, self.kinds[name]
        if name in GIVEN:
            return GIVEN[name], "Number"
        if name in self.scheme.constants:
            return name, self.scheme.constants[name]
        raise self.text.refused(node, "a name that nothing sets before it")

    def operation(self, node: ast.AST, left: ast.expr, operator: ast.operator, right: ast.expr) -> tuple[str, str]:
        """Print arithmetic; whole numbers are not divided by each other."""
        (one, kind), (two, another) = self.value(left), self.value(right)
        wider = _wider(kind, another)
        if wider == "bool" and not isinstance(operator, ast.BitOr):
            wider = "int"
        if isinstance(operator, ast.Pow):
            return f"pow({one}, {two})", wider
        if type(operator) in WHOLE and wider in ("int", "Count"):
            return f"{one} {WHOLE[type(operator)]} {two}", wider
        if (
            type(operator) not in SIGNS
            or not {kind, another} <= PLAIN.keys()
            or (isinstance(operator, ast.Div) and wider in ("int", "Count"))
        ):
            raise self.text.refused(node, f"an operation of {kind} and {another}")
        return f"{one} {SIGNS[type(operator)]} {two}", wider

    def comparison(
        self, node: ast.expr, left: ast.expr, operators: Sequence[ast.cmpop], others: Sequence[ast.expr]
    ) -> str:
        """Print a comparison, also one of three numbers, or one with None."""
        match left, operators, others:
            case _, [ast.In()], [ast.Tuple(elts=several)]:
                return " || ".join(f"({self.value(left)[0]} == {self.value(one)[0]})" for one in several)
            case ast.Name() | ast.Attribute(), [ast.Is() | ast.IsNot() as operator], [ast.Constant(value=None)]:
                text, kind = self.value(left)
                if text not in self.optional and kind not in self.scheme.given:
                    raise self.text.refused(node, "what is never None")
                has = "" if kind in self.scheme.given else "has_"
                return f"{'!' if isinstance(operator, ast.Is) else ''}{has}{text}"
            case _:
                pass
        if len(others) > 1 and not all(isinstance(one, (ast.Name, ast.Constant, ast.Attribute)) for one in others[:-1]):
            raise self.text.refused(node, "a number between others that is computed twice")
        texts, kinds = zip(*(self.value(one) for one in (left, *others)), strict=True)
        same = all(isinstance(one, (ast.Is, ast.IsNot)) for one in operators)
        if any(kind not in PLAIN for kind in kinds) != same:
            raise self.text.refused(node, f"a comparison of {' and '.join(kinds)}")
        pairs = [f"{texts[k]} {SIGNS[type(one)]} {texts[k + 1]}" for k, one in enumerate(operators)]
        return pairs[0] if len(pairs) == 1 else " && ".join(f"({pair})" for pair in pairs)

    def folded(self, name: str, arguments: Sequence[ast.expr]) -> tuple[str, str]:
        """Print a function of numbers; that of several is one of two at a time."""
        texts, kinds = zip(*(self.value(one, outer=True) for one in arguments), strict=True)
        if (name in CALLS) != (len(arguments) == 1) or any(kind not in PLAIN for kind in kinds):
            raise self.text.refused(arguments[0], f"arguments of {name}")
        if name in CALLS:
            return f"{CALLS[name]}({texts[0]})", kinds[0]
        text, kind = texts[0], "Number"
        for other, another in zip(texts[1:], kinds[1:], strict=True):
            text, kind = f"{FOLDED[name]}({text}, {other})", _wider(kind, another)
        return text, kind


def _wider(kind: str, another: str) -> str:
    """The kind of an operation on two kinds."""
    return next((one for one in ("Time", "Number", "Count", "int") if one in (kind, another)), kind)


def _kind(annotation: ast.expr) -> str:
    return ast.unparse(annotation).removesuffix(MAY_BE_NONE)


def _of_list(kind: str) -> str:
    return kind.removeprefix("list[").removesuffix("]")


def _places(part: ast.AST, how: type[ast.expr_context]) -> set[str]:
    """The names, fields and vectors that are set there, or read."""
    found = (node for node in ast.walk(part) if isinstance(getattr(node, "ctx", None), how))
    return {ast.unparse(node.value if isinstance(node, ast.Subscript) else node) for node in found}


def _decorators(part: ast.FunctionDef) -> list[str]:
    return [ast.unparse(one) for one in part.decorator_list]


def _is_docstring(part: ast.stmt) -> bool:
    return isinstance(part, ast.Expr) and isinstance(part.value, ast.Constant)


def _comment(text: str, where: str) -> str:
    words = " ".join(text.replace("``", "").split())
    return fill(f"/* {words} ({where}) */", 120, subsequent_indent="   ") + "\n"


@cache
def printed() -> dict[str, str]:
    """The C that the texts are printed as: ``scheme.h`` with their records, and a file for each text."""
    scheme = Scheme([Text.of(name, (FOLDER / f"{name}.py").read_text()) for name in (BY_HAND, *TEXTS)])
    header = f"#ifndef HS_SCHEME_H\n#define HS_SCHEME_H\n\n{scheme.header()}\n#endif\n"
    return {"scheme.h": header} | {f"{text.name}.c": scheme.module(text) for text in scheme.texts[1:]}
