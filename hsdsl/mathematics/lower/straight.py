# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false, reportReturnType=false
"""Expressions as straight-line code: small statements in order, their derivatives, and the text of routines.

SymPy's expressions are graphs, but it walks, differentiates and prints them as trees: what is written in a few lines
(a product of a thousand factors, a name of `let` that uses the one before it twice, twenty times) can have a
derivative or a text without end. `Cut` gives names to parts that are too large, so that each of these costs as much as
the graph has nodes, and `Gradient` differentiates such statements by the chain rule. `shared` gives names to what comes
more than once; SymPy's `cse` does as much in a time that grows faster than the expressions do.

Linear equations are solved by statements: the modified Gram-Schmidt process on the matrix with the right side as a
further column is backward stable in any order of the equations, and the same for any unit of an unknown (A. Bjorck,
*Solving linear least squares problems by Gram-Schmidt orthogonalization*, BIT 7, 1967, doi:10.1007/BF01934122). Rows
are divided by their norms before.
"""

from __future__ import annotations

import re
import textwrap
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from heapq import heapify, heappop, heappush
from itertools import accumulate, chain, combinations
from typing import NamedTuple

import sympy as sp

from hsdsl.base.functions import as_written, below, rebuilt, solution
from hsdsl.language.expression.algebra import Shape, derivative, moving
from hsdsl.mathematics.lower.printer import LARGEST_PRODUCT, KernelPrinter
from hsdsl.mathematics.program import Routines

Statement = tuple[sp.Symbol, sp.Basic]


def shared(expressions: Sequence[sp.Basic], letter: str) -> tuple[list[Statement], list[sp.Basic]]:
    """Statements that give names, and the expressions written with them."""
    found = _Shared(expressions, letter)
    return found.statements, found.expressions


class _Shared:
    def __init__(self, expressions: Iterable[sp.Basic], letter: str) -> None:
        self._letter = letter
        self._uses: Counter[sp.Basic] = Counter()
        self._operands: dict[sp.Basic, tuple[sp.Basic, ...]] = {}
        self._sums: dict[frozenset, sp.Basic] = {}  # the first of those that are alike up to signs
        self._written: dict[sp.Basic, sp.Basic] = {}
        self.statements: list[Statement] = []
        given = tuple(expressions)
        for expr in given:
            self._count(expr)
        for operation in (sp.Mul, sp.Add):
            self._pair(operation)
        self.expressions = [self._new(expr) for expr in given]

    def _count(self, expr: sp.Basic) -> None:
        """Count the uses of an expression and of its parts, each once; those of the negative of one are its own."""
        if expr.is_Atom:
            return
        expr = self._known(expr)
        self._uses[expr] += 1
        if self._uses[expr] == 1:
            self._operands[expr] = _operands(expr)
            if expr.is_Add:
                self._sums.setdefault(_unsigned(expr), expr)
            for part in self._operands[expr]:
                self._count(part)

    def _known(self, expr: sp.Basic) -> sp.Basic:
        """The expression or its negative: of products the positive one, of sums the one that came first."""
        if expr.is_Mul:
            return -expr if expr.args[0].is_Number and expr.args[0] < 0 else expr
        if expr.is_Add and expr not in self._operands and _unsigned(expr) in self._sums:
            negative = -expr  # which takes SymPy long
            return negative if negative in self._operands else expr
        return expr

    def _pair(self, operation: type) -> None:
        """Give names to pairs of operands, those first that most have in common."""
        wholes = [expr for expr in self._operands if isinstance(expr, operation)]
        for pair, owners in _pairs([self._operands[expr] for expr in wholes], operation):
            others = [wholes[i] for i in owners if wholes[i] != pair]
            self._operands[pair] = pair.args
            self._uses[pair] += len(others)
            for part in pair.args:
                self._uses[self._known(part)] -= len(owners) - 1
            for whole in others:
                rest = [part for part in self._operands[whole] if part not in pair.args]
                self._operands[whole] = (*(x for x in rest if x.is_Number), pair, *(x for x in rest if not x.is_Number))

    def _new(self, expr: sp.Basic) -> sp.Basic:
        if expr.is_Atom:
            return expr
        if expr not in self._operands:
            inner = self._new(self._known(expr))
            return -inner if inner.is_Mul else sp.Mul._from_args((sp.S.NegativeOne, inner))
        if expr not in self._written:
            written = self._rebuilt(expr)
            if self._uses[expr] > 1:
                real = {"real": True} if isinstance(expr, sp.Expr) else {}
                name = sp.Symbol(f"{self._letter}{len(self.statements)}", **real)
                self.statements.append((name, written))
                written = name
            self._written[expr] = written
        return self._written[expr]

    def _rebuilt(self, expr: sp.Basic) -> sp.Basic:
        parts = [self._new(part) for part in self._operands[expr]]
        if _is_quotient(expr):
            return sp.Pow(parts[0], -1, evaluate=False)
        return as_written(expr, parts)


def _unsigned(expr: sp.Add) -> frozenset:
    """What a sum and its negative have in common, and few others."""
    return frozenset(_factors(part) for part in expr.args)


def _factors(term: sp.Basic) -> tuple[sp.Basic, ...]:
    if term.is_Mul:
        return term.args[term.args[0].is_Number :]
    return (abs(term) if term.is_Number else term,)


def _is_quotient(expr: sp.Basic) -> bool:
    return expr.is_Pow and expr.exp.is_Number and expr.exp < 0


def _operands(expr: sp.Basic) -> tuple[sp.Basic, ...]:
    return (expr.base**-expr.exp,) if _is_quotient(expr) else expr.args


def _pairs(lists: Sequence[Sequence[sp.Basic]], operation: type) -> Iterator[tuple[sp.Basic, list[int]]]:
    """The pairs that most of some lists have in common, until no two have one, and in which lists each is."""
    numbers: dict[sp.Basic, int] = {}
    own = [[numbers.setdefault(operand, len(numbers)) for operand in each] for each in lists]
    operands, where = list(numbers), defaultdict[tuple[int, int], set[int]](set)
    for i, each in enumerate(own):
        for pair in combinations(sorted(each), 2):
            where[pair].add(i)
    waiting = [(-len(owners), pair) for pair, owners in where.items() if len(owners) > 1]
    heapify(waiting)
    while waiting:
        count, pair = heappop(waiting)
        owners = sorted(where.pop(pair, ()))
        if len(owners) < 2:
            continue
        if len(owners) < -count:
            where[pair] = set(owners)
            heappush(waiting, (-len(owners), pair))
            continue
        made = operation._from_args([operands[k] for k in own[owners[0]] if k in pair])
        yield made, owners
        for i in owners:
            own[i] = [k for k in own[i] if k not in pair]
            for k in own[i]:
                for old in pair:
                    where[min(k, old), max(k, old)].discard(i)
                where[k, len(operands)].add(i)
        new = [(k, len(operands)) for k in dict.fromkeys(k for i in owners for k in own[i])]
        for i in owners:
            own[i].append(len(operands))
        operands.append(made)
        for each in new:
            if len(where[each]) > 1:
                heappush(waiting, (-len(where[each]), each))


# a column counts as one of the space of those before it where no more than this share of it is left: round-off of
# 64-bit floats, with room for the sums of a few hundred terms
_LEFT = sp.Rational(1, 2**44)
Named = Callable[[sp.Basic], sp.Basic]


def solved(rows: Sequence[Sequence[sp.Basic]], constants: Sequence[sp.Basic], name: Named) -> list[sp.Basic]:
    """The unknowns x of A x = b; where A is singular they have no finite value.

    ``name`` gives an expression a name; where it is one, statements stay small.
    """
    n = len(rows)
    sizes = [name(sp.sqrt(_squares(row))) for row in rows]
    columns = [[name(rows[r][c] / sizes[r]) for r in range(n)] for c in range(n)]
    right = [name(constants[r] / sizes[r]) for r in range(n)]
    whole = [name(_squares(column)) for column in columns]
    pivots: list[sp.Basic] = []
    factors: list[list[sp.Basic]] = []
    for k in range(n):
        left = name(_squares(columns[k]))
        pivots.append(name(below(name(left - _LEFT**2 * whole[k]), sp.S.Zero, sp.S.Zero, name(sp.sqrt(left)))))
        direction = [name(entry / pivots[k]) for entry in columns[k]]
        row: list[sp.Basic] = []
        for column in (*columns[k + 1 :], right):
            share = name(sp.Add(*(q * entry for q, entry in zip(direction, column, strict=True))))
            row.append(share)
            column[:] = [name(entry - share * q) for q, entry in zip(direction, column, strict=True)]
        factors.append(row)
    unknowns: list[sp.Basic] = []
    for k in reversed(range(n)):
        *others, value = factors[k]
        known = sp.Add(*(factor * x for factor, x in zip(others, unknowns, strict=True)))
        unknowns.insert(0, name((value - known) / pivots[k]))
    return unknowns


def _squares(entries: Sequence[sp.Basic]) -> sp.Basic:
    return sp.Add(*(entry**2 for entry in entries))


LARGEST = 80  # nodes of one statement
WIDEST = 16  # terms or factors of one statement


class Cut:
    """Expressions cut down to statements of bounded size, in the order of computation.

    With ``powers`` the base of a power that is printed as a product is a name, which can be repeated at no cost. With
    ``whole`` each unknown of linear equations is a statement, which is left to a later cut to solve.
    """

    def __init__(self, letter: str, powers: bool = False, whole: bool = False) -> None:
        self._powers, self._whole = powers, whole
        self.statements: list[Statement] = []
        self._letter = letter
        self._names: dict[sp.Basic, sp.Symbol] = {}
        self._done: dict[sp.Basic, tuple[sp.Basic, int]] = {}
        self._solutions: dict[tuple, list[sp.Basic]] = {}

    def name(self, expr: sp.Basic) -> sp.Basic:
        """Give an expression a name of its own, unless it is a name or a number."""
        if expr.is_Atom:
            return expr
        if expr not in self._names:
            real = {"real": True} if isinstance(expr, sp.Expr) else {}
            self._names[expr] = sp.Symbol(f"{self._letter}{len(self.statements)}", **real)
            self.statements.append((self._names[expr], expr))
        return self._names[expr]

    def define(self, symbol: sp.Symbol, expr: sp.Basic) -> None:
        """Add a statement; the parts of it that are too large come before it."""
        self.statements.append((symbol, self.down(expr)))

    def down(self, expr: sp.Basic) -> sp.Basic:
        """Return the same expression with names for parts that are too large to be written out."""
        return self._cut(expr)[0]

    def _cut(self, expr: sp.Basic) -> tuple[sp.Basic, int]:
        if expr.is_Atom or not expr.args:
            return expr, 1
        if expr not in self._done:
            self._done[expr] = self._node(expr)
        return self._done[expr]

    def _node(self, expr: sp.Basic) -> tuple[sp.Basic, int]:
        parts = [self._cut(a) for a in expr.args]
        if isinstance(expr, solution):
            unknown = expr.func(*(self.name(part) for part, _ in parts))
            return self.name(unknown) if self._whole else self._solved(unknown), 1
        if self._powers and expr.is_Pow and expr.exp.is_Integer and abs(expr.exp) <= LARGEST_PRODUCT:
            parts = [(self.name(part), 1) if abs(expr.exp) > 1 else (part, size) for part, size in parts]
        if expr.is_Pow and expr.base.is_Pow:
            parts = [(self.name(parts[0][0]), 1), parts[1]]  # see `power`
        if isinstance(expr, sp.Tuple):
            return sp.Tuple(*(part for part, _ in parts), sympify=False), 1
        if 1 + sum(size for _, size in parts) > LARGEST:
            parts = [(self.name(part), 1) if size > LARGEST // 4 else (part, size) for part, size in parts]
        if isinstance(expr, (sp.Add, sp.Mul, sp.And, sp.Or)):
            parts = self._narrow(expr.func, parts)
        args = tuple(part for part, _ in parts)
        if args == expr.args:
            return expr, 1 + sum(size for _, size in parts)
        return rebuilt(expr, args), 1 + sum(size for _, size in parts)

    def _solved(self, expr: sp.Basic) -> sp.Basic:
        """The name of an unknown of linear equations, which are solved by statements once for all unknowns."""
        place, rows, constants = expr.system
        if (rows, constants) not in self._solutions:
            self._solutions[rows, constants] = solved(rows, constants, self.name)
        return self._solutions[rows, constants][place]

    def _narrow(self, operation: type, parts: list[tuple[sp.Basic, int]]) -> list[tuple[sp.Basic, int]]:
        """Name the first operands together, as long as the rest is too wide or too large."""
        while len(parts) > WIDEST or (len(parts) > 2 and sum(size for _, size in parts) > LARGEST):
            fit = max(2, sum(size < LARGEST for size in accumulate(size for _, size in parts[:WIDEST])))
            parts = [(self.name(operation(*(part for part, _ in parts[:fit]))), 1), *parts[fit:]]
        return parts


class Gradient:
    """First derivatives of expressions, and the statements that they are written with.

    For each expression, ``sparse`` has its derivatives by those arguments where they are not zero, in the arguments'
    order (their numbers, where they are a mapping), and ``rows`` those by all arguments. ``statements`` are the names
    in them, in the order of computation; none where the expressions are small. With ``whole`` unknowns of linear
    equations, and their derivatives, are left to a later cut to solve.
    """

    def __init__(
        self, expressions: Iterable[sp.Expr], arguments: Iterable[sp.Symbol], letter: str = "g", whole: bool = False
    ) -> None:
        self._arguments = arguments
        given_order = isinstance(arguments, Mapping)
        self._order = arguments if given_order else {argument: i for i, argument in enumerate(arguments)}
        given = tuple(expressions)
        self._cut = Cut(letter, whole=whole)
        small = [self._cut.down(e) for e in given]
        if self._cut.statements:  # what comes more than once is differentiated once
            common, small = shared(given, f"{letter}_")
            self._cut = Cut(letter, whole=whole)
            for symbol, expr in common:
                self._cut.define(symbol, expr)
            small = [self._cut.down(e) for e in small]
        self._slopes: dict[sp.Symbol, dict[sp.Symbol, sp.Expr]] = {}
        for symbol, expr in tuple(self._cut.statements):
            self._slopes[symbol] = {a: self._cut.name(d) for a, d in self._row(expr).items()}
        self.sparse = tuple(self._row(e) for e in small)
        self.statements = self._cut.statements

    @property
    def rows(self) -> tuple[tuple[sp.Expr, ...], ...]:
        return tuple(tuple(row.get(a, sp.S.Zero) for a in self._arguments) for row in self.sparse)

    def _row(self, expr: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
        if isinstance(expr, solution):
            return self._row_of_solution(expr)
        present = moving(expr)
        direct = {a: derivative(expr, a) for a in present & self._order.keys()}
        for symbol in sorted(present & self._slopes.keys(), key=lambda s: s.name):
            slope = self._cut.name(derivative(expr, symbol))
            for argument, inner in self._slopes[symbol].items():
                direct[argument] = direct.get(argument, sp.S.Zero) + slope * inner
        return {a: direct[a] for a in sorted(direct, key=self._order.__getitem__) if direct[a] != 0}

    def _row_of_solution(self, expr: solution) -> dict[sp.Symbol, sp.Expr]:
        """The derivatives of an unknown of A x = b: those of x solve A x' = b' - A' x."""
        place, rows, constants = expr.system
        unknowns = [self._cut.name(solution(sp.Integer(c), *expr.args[1:])) for c in range(len(rows))]
        moved = [[self._row(entry) for entry in (*row, b)] for row, b in zip(rows, constants, strict=True)]
        present = set[sp.Symbol]().union(*(slopes for row in moved for slopes in row))
        found: dict[sp.Symbol, sp.Expr] = {}
        for a in sorted(present, key=self._order.__getitem__):
            right: list[sp.Expr] = []
            for *entries, b in moved:
                through = (slopes[a] * x for slopes, x in zip(entries, unknowns, strict=True) if a in slopes)
                right.append(self._cut.name(b.get(a, sp.S.Zero) - sp.Add(*through)))
            if any(right):
                found[a] = solution(sp.Integer(place), *expr.args[1 : -len(rows)], *right)
        return found


def in_order(statements: Iterable[Statement], results: sp.Basic) -> list[Statement]:
    """The statements that the results need, each after those it uses."""
    known = dict(statements)
    ordered: dict[sp.Symbol, sp.Basic] = {}

    def visit(expr: sp.Basic) -> None:
        for symbol in sorted(expr.free_symbols & known.keys(), key=lambda s: s.name):
            if symbol not in ordered:
                visit(known[symbol])
                ordered[symbol] = known[symbol]

    visit(results)
    return list(ordered.items())


class Definition(NamedTuple):
    """A routine before printing: its name, arguments and tuple of results.

    ``statements`` are the names that the results use besides the arguments, and their expressions. With ``places``
    only the arguments that are used have a name in the text: of many small routines with many arguments each, the
    heads would be all there is. ``places`` has the index of each argument.
    """

    name: str
    arguments: tuple[sp.Symbol, ...]
    results: tuple
    statements: Sequence[Statement] = ()
    places: Mapping[sp.Symbol, int] | None = None


class Alike(NamedTuple):
    """A routine before printing whose results and statements can be made from expressions of a shape.

    They are made once for all routines of a ``kind`` and that shape. ``places`` has the index of each argument.
    """

    name: str
    kind: object
    shape: Shape
    write: Callable[[], tuple[tuple, Sequence[Statement]]]
    places: Mapping[sp.Symbol, int]


def text_of(definition: Definition | Alike) -> str:
    """Print one routine as a Python function."""
    if isinstance(definition, Alike):
        shape, places = definition.shape, definition.places
        body = _text(shape, definition.kind, lambda: _body(*definition.write()))
        return _few(definition.name, shape.symbols.keys() & places.keys(), places, body)
    results, statements = tuple(map(sp.sympify, definition.results)), tuple(definition.statements)
    shape = Shape((*results, *(part for statement in statements for part in statement)))
    body = _text(shape, len(results), lambda: _body(results, statements))
    if definition.places is None:
        return f"def {definition.name}({', '.join(s.name for s in definition.arguments)}):\n{body}"
    return _few(definition.name, shape.symbols.keys() & definition.places.keys(), definition.places, body)


def _few(name: str, given: Iterable[sp.Symbol], places: Mapping[sp.Symbol, int], body: str) -> str:
    """A routine that names those of some arguments that it uses."""
    words = set(re.findall(r"\w+", body))
    named = sorted((places[symbol], symbol.name) for symbol in given if symbol.name in words)
    return f"def {name}(*given):\n{''.join(f'    {each} = given[{i}]{chr(10)}' for i, each in named)}{body}"


def _body(results: tuple, statements: Sequence[Statement]) -> str:
    return _returned(*_lines(results, tuple(statements)))


def _lines(results: tuple, statements: tuple[Statement, ...]) -> tuple[list[str], list[str]]:
    """The statements, and the results."""
    statements, results = written_out(results, statements)
    return [f"    {symbol.name} = {_printed(expr)}\n" for symbol, expr in statements], list(map(_printed, results))


def _returned(lines: Sequence[str], results: Sequence[str]) -> str:
    return f"{''.join(lines)}    return ({''.join(f'{result}, ' for result in results)})\n"


def _printed(expr: sp.Basic) -> str:
    return expr.name if expr.is_Symbol else _text(Shape((expr,)), None, lambda: KernelPrinter().doprint(expr))


_WORD = re.compile(r"(?<!\w)([a-z_]+\d+)(?!\w)")
_MOST_SHAPES = 1 << 14
_Template = tuple[list[str], list[int]]
_texts: dict[tuple, _Template] = {}


def _text(shape: Shape, kind: object, write: Callable[[], str]) -> str:
    """The text of a ``kind`` that is written of the expressions of a shape, once."""
    key = (kind, *shape.key)
    if key not in _texts:
        used = _template(write(), {name: i for i, name in enumerate(shape.names)})
        if len(_texts) >= _MOST_SHAPES:
            _texts.clear()
        _texts[key] = used
    return _filled(_texts[key], shape.names)


def _template(text: str, places: Mapping[str, int]) -> _Template:
    """Cut a text at the names that have places: the texts between them, and these places."""
    pieces = _WORD.split(text)
    texts, used = pieces[:1], list[int]()
    for word, after in zip(pieces[1::2], pieces[2::2], strict=True):
        if word in places:
            used.append(places[word])
            texts.append(after)
        else:
            texts[-1] += word + after
    return texts, used


def _filled(template: _Template, values: Sequence[str]) -> str:
    """Put values at the places of a template."""
    texts, used = template
    return "".join(chain(texts[:1], *zip(map(values.__getitem__, used), texts[1:], strict=True)))


def written_out(results: tuple, statements: Sequence[Statement] = ()) -> tuple[list[Statement], tuple]:
    """Cut down statements and results, and take out their common parts."""
    cut = Cut("v", powers=True)
    given = [(symbol, cut.down(expr)) for symbol, expr in statements]
    small = [cut.down(expr) for expr in map(sp.sympify, results)]
    known = [*given, *cut.statements]
    common, reduced = shared([*(e for _, e in known), *small], "w")
    last = tuple(reduced)[len(known) :]
    named = zip((symbol for symbol, _ in known), reduced, strict=False)
    return in_order([*common, *named], sp.Tuple(*last)), last


class _Written:
    """How the result of expressions of one shape is written: statements, each with the numbers of its operands.

    Those are the places of symbols among the names of the shape, and after them those of the statements before it.
    The last statement is the result.
    """

    def __init__(self, definition: Definition, names: Sequence[str]) -> None:
        places = {name: i for i, name in enumerate(names)}
        self.lines: list[_Template] = []
        for line in _body(definition.results, definition.statements).splitlines():
            name, _, text = line.strip().rpartition(" = ")
            self.lines.append(_template(text.removeprefix("return (").removesuffix(", )"), places))
            places[name] = len(names) + len(self.lines) - 1

    def text(self, names: Sequence[str], known: dict[str, str]) -> str:
        """The result over symbols of these names; statements get the names that they are ``known`` by, or new ones."""
        values, text = list(names), ""
        for line in self.lines:
            text = _filled(line, values)
            if len(values) < len(names) + len(self.lines) - 1:
                values.append(text if line[0] == ["", ""] else known.setdefault(text, f"u{len(known)}"))
        return text


# So many expressions of one shape are written one by one. Fewer are written together: what they have in common is
# computed once, and bounds keep their bits in models without many alike parts.
LEAST_ALIKE = 8


def print_each(
    name: str,
    expressions: Sequence[sp.Basic],
    write: Callable[..., Definition],
    beside: Mapping[sp.Basic, sp.Basic],
    places: Mapping[sp.Symbol, int],
    data: Sequence[sp.Symbol],
) -> Routines:
    """One routine of what is written of some expressions, one result of each.

    What many parts have in one shape is written once, and statements that are the same are one; the other expressions
    are written together. ``beside`` has a symbol that may be written where another one is in an expression, and
    ``places`` the index of each argument.
    """
    shapes = [Shape((expr,), beside) for expr in expressions]
    alike = Counter(shape.key for shape in shapes)
    others = [k for k, shape in enumerate(shapes) if alike[shape.key] < LEAST_ALIKE]
    definition = write(*(expressions[k] for k in others))
    lines, found = _lines(definition.results, tuple(definition.statements))
    results, known, written = dict(zip(others, found, strict=True)), dict[str, str](), dict[tuple, _Written]()
    for k, shape in enumerate(shapes):
        if k in results:
            continue
        if shape.key not in written:
            written[shape.key] = _Written(write(expressions[k]), shape.names)
        results[k] = written[shape.key].text(shape.names, known)
    lines += [f"    {each} = {text}\n" for text, each in known.items()]
    body = _returned(lines, [results[k] for k in range(len(shapes))])
    given = set[sp.Symbol]().union(*(shape.symbols for shape in shapes)) & places.keys()
    return _bound((name,), _few(name, given, places, body), data)


def print_routines(definitions: Iterable[Definition | Alike], data: Sequence[sp.Symbol]) -> Routines:
    """Put routines into one ``bind`` whose arguments are the data they close over."""
    definitions = tuple(definitions)
    return _bound(tuple(d.name for d in definitions), "".join(map(text_of, definitions)), data)


def _bound(names: tuple[str, ...], text: str, data: Sequence[sp.Symbol]) -> Routines:
    body = textwrap.indent(text, "    ")
    head = f"def bind({', '.join(s.name for s in data)}):\n"
    result = f"({', '.join(names)},)" if names else "()"
    return Routines(names, f"{head}{body}    return {result}\n")
