"""A tape as C functions that write Taylor coefficients: coefficient 0 of every line, then a loop over the others.

The constants of a tape are arguments, so that modes which differ in numbers alone share one function. Of a large tape
each coefficient is written by pieces (`routine.pieces`), which the functions of motions along guards call too. The sums
of products that share a factor go in one loop, as the derivatives of a product have them.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

from hsdsl.engine.backends.c.routine import LARGE, Assignment, expression, pieces
from hsdsl.engine.backends.taylor import TapeLanguage, coefficient_of, value_of
from hsdsl.mathematics.program import Tape

LONGEST_NESTED = 32  # operations of a line that is part of an expression
_LINE = re.compile(r"\bl(\d+)\b")
_FLOW = """\
static int NAME(const hs_real *restrict c, int order, hs_real t, const hs_real *restrict x,
                hs_real *restrict lines) {{
  int bad = 0;
  const int length = order + 2;
  (void)c, (void)t, (void)x;
{pointers}{arrays}
  l0[0] = t;
  l0[1] = 1.0;
  for (int k = 2; k < length; k++) l0[k] = 0.0;
{values}
  if (bad) return bad;
  for (int k = 1; k <= order; k++) {{
{coefficients}
  }}
  return bad;
}}
"""
_SURFACES = """\
static int NAME(const hs_real *restrict c, int order, hs_real *restrict lines) {{
  int bad = 0;
  const int length = order + 2;
{pointers}
  (void)c, (void)l0;
{values}
  if (bad) return bad;
  for (int k = 1; k <= order; k++) {{
{coefficients}
  }}
  return bad;
}}
"""
_PIECE = """\
static HS_APART int {name}(const hs_real *restrict c, int k, int length, hs_real *restrict lines) {{
  int bad = 0;
  (void)c, (void)k, (void)length, (void)lines;
{body}
  return bad;
}}
"""
_CALLS = """\
static int NAME(const hs_real *c, int k, int length, hs_real *lines) {{
  return {calls};
}}
"""


def line_count(tape: Tape, dimension: int) -> int:
    """How many lines there are: time, the states, operations."""
    return 1 + dimension + len(tape.operations)


def is_large(tape: Tape, dimension: int) -> bool:
    """Whether a tape's lines are written in pieces."""
    return line_count(tape, dimension) > LARGE


def flow_lines(tape: Tape, dimension: int, further: Container[int], in_pairs: bool = False) -> str:
    """Write the function of the lines that the flow needs; its name is to be put in for ``NAME``.

    The states' newest coefficients stay in variables ``w``: each waits for the one before, and memory is slower. Those
    of other lines are put into memory where something reads them there: ``further`` are lines that others read. With
    ``in_pairs`` products go in vectors of two.
    """
    first, states = dimension + 1, range(1, dimension + 1)

    def value(line: int) -> str:
        return "t" if line == 0 else f"x[{line - 1}]" if line < first else f"v{line}"

    def newest(line: int) -> str:
        return "l0[k]" if line == 0 else f"w{line}" if line < first else f"v{line}"

    own = range(first, first + tape.needed)
    groups = shared(tape, own, first, in_pairs)
    sums = {i: text for group in groups for i, text in group.sums.items()}
    texts = [(i, sums.get(i, text)) for i, text in _coefficients(tape, own, first, newest)]
    loops = {i: keeping + loop for i, (keeping, loop) in statements(groups, newest).items()}
    read = _lines_in([*(text for _, text in texts), *chain(*loops.values())])
    read.update(i for i in own if i in further)
    values = [f"l{i}[0] = {value(i)};" for i in states]
    kept = {i: keeping for i, (keeping, _) in statements(groups, value).items()}
    values += _straight(_values(tape, own, first, value), read, kept)
    values += [f"hs_real w{i} = l{i}[1] = {value(tape.flow[i - 1])}; (void)w{i};" for i in states]
    coefficients = _straight(texts, read, loops)
    coefficients += [f"const hs_real u{i} = {newest(tape.flow[i - 1])} * hs_inverse[k + 1];" for i in states]
    coefficients += [f"w{i} = l{i}[k + 1] = u{i};" for i in states]
    return _filled(_FLOW, values, coefficients, [*arrays(groups).values()])


def surface_lines(tape: Tape, dimension: int) -> str:
    """Write the function of the further lines, which surfaces need."""
    first = dimension + 1
    own = range(first + tape.needed, first + len(tape.operations))

    def value(line: int) -> str:
        return f"v{line}" if line in own else f"l{line}[0]"

    def newest(line: int) -> str:
        return f"v{line}" if line in own else f"l{line}[k]"

    values, coefficients = (each(tape, own, first, name) for each, name in ((_values, value), (_coefficients, newest)))
    return _filled(_SURFACES, _straight(values, own), _straight(coefficients, own))


def piecewise(
    tape: Tape, dimension: int, own: range, states: Iterable[int], further: Container[int]
) -> tuple[str, list[str]]:
    """Write a function ``NAME`` for coefficient k of ``own`` lines, then k + 1 of ``states``, and its pieces.

    States are lines too. The pieces are functions of a name that begins with ``NAME_``. A line goes into memory where
    others read it there, or ``further`` lines do; else it is part of the expression that reads it.
    """
    first = dimension + 1
    inside = _inside(tape, own, first, states, further)
    parts: list[str] = []
    calls: list[str] = []
    for kind, each, place in (("coefficients", _coefficients, "k"), ("values", _values, "0")):
        names = list[str]()
        for body in pieces(_nested(tape, own, first, states, inside, each, f"l{{}}[{place}]")):
            names.append(f"NAME_{kind}_{len(names)}")
            parts.append(_PIECE.format(name=names[-1], body="\n".join(f"  {line}" for line in body)))
        calls.append(" || ".join(f"{name}(c, k, length, lines)" for name in names))
    return _CALLS.format(calls=f"k ? {calls[0]} : {calls[1]}"), parts


def _inside(tape: Tape, own: range, first: int, states: Iterable[int], further: Container[int]) -> set[int]:
    """The lines whose newest coefficient one expression reads, and nothing else."""
    reads = Counter(tape.flow[i - 1] for i in states)
    reads.update(line for i in own for line in tape.operations[i - first].lines)
    earlier = _lines_in(text for _, text in _coefficients(tape, own, first, "{}".format))
    found, sizes = set[int](), dict[int, int]()
    for i in own:
        sizes[i] = 1 + sum(sizes[line] for line in tape.operations[i - first].lines if line in found)
        if reads[i] == 1 and i not in earlier and i not in further and sizes[i] < LONGEST_NESTED:
            found.add(i)
    return found


def _nested(
    tape: Tape, own: range, first: int, states: Iterable[int], inside: set[int], each: Callable[..., Texts], place: str
) -> list[Assignment]:
    """The assignments of newest coefficients, of lines and then of states, with those ``inside`` written out."""
    texts, needs = dict[int, str](), dict[int, set[int]]()
    places = {line: n for n, line in enumerate(line for line in own if line not in inside)}

    def name(line: int) -> str:
        return f"({texts[line]})" if line in inside else place.format(line)

    def beyond(lines: Iterable[int], i: int) -> set[int]:
        return set[int]().union(
            *(needs[j] if j in inside else {places[j]} for j in lines if j in inside or (j in places and j < i))
        )

    for i, text in each(tape, own, first, name):
        texts[i], needs[i] = text, beyond(tape.operations[i - first].lines, i)
    found = [Assignment(f"l{i}[k]", texts[i], needs[i]) for i in places]
    for i in states:
        line = tape.flow[i - 1]
        found.append(Assignment(f"l{i}[k + 1]", f"{name(line)} * hs_inverse[k + 1]", beyond([line], own.stop)))
    return found


def _straight(
    texts: Iterable[tuple[int, str]], kept: Container[int], before: Mapping[int, Sequence[str]] | None = None
) -> list[str]:
    """The statements for lines that are variables too, ``v``; those in ``kept`` go into memory."""
    found: list[str] = []
    for i, text in texts:
        found += (before or {}).get(i, ())
        found.append(f"const hs_real v{i} = {text};")
        if i in kept:
            found.append(f"l{i}[@] = v{i};")
    return found


def read_by_surfaces(tape: Tape) -> set[int]:
    """The lines that surfaces are, or are computed from."""
    further = {line for operation in tape.operations[tape.needed :] for line in operation.lines}
    return further | {line for line in tape.surfaces if line is not None}


Texts = Iterator[tuple[int, str]]  # of lines


def _values(tape: Tape, lines: Iterable[int], first: int, name: Callable[[int], str]) -> Texts:
    language = _language("c{}".format, "n{}".format, "q_0_1")
    for i in lines:
        operation = tape.operations[i - first]
        names = {f"n{line}": name(line) for line in operation.lines}
        names[f"c{operation.constant}"] = f"c[{operation.constant}]"
        yield i, expression(value_of(operation, language), names)


def _coefficients(tape: Tape, lines: Iterable[int], first: int, name: Callable[[int], str]) -> Texts:
    language = _language("c[{}]".format, name, "0.0")
    return ((i, coefficient_of(i, tape.operations[i - first], language)) for i in lines)


def _language(constant: Callable[[int], str], name: Callable[[int], str], zero: str) -> TapeLanguage:
    return TapeLanguage(
        series="l{}".format,
        value=name,
        newest=name,
        constant=constant,
        zero=zero,
        call="hs_",
        bad=", &bad",
        least="k < {0} ? k : {0}".format,
    )


def _lines_in(texts: Iterable[str]) -> set[int]:
    """The lines that texts read in memory."""
    return {int(i) for text in texts for i in _LINE.findall(text)}


def _filled(template: str, values: list[str], coefficients: list[str], pairs: Sequence[str] = ()) -> str:
    used = sorted({0} | _lines_in((*values, *coefficients)))
    return template.format(
        pointers="\n".join(f"  hs_real *const l{i} = lines + {i} * length;" for i in used),
        arrays="".join(f"\n  hs_pair {name}[HS_MOST_ORDER + 2];" for name in pairs),
        values="\n".join(f"  {text.replace('[@]', '[0]')}" for text in values),
        coefficients="\n".join(f"    {text.replace('[@]', '[k]')}" for text in coefficients),
    )


TOGETHER = 6  # products in a loop: their sums and two factors are in registers
PAIRS_TOGETHER = 4  # the same, of pairs of products
Pair = tuple[int, int]


@dataclass(frozen=True)
class Shared:
    """Products of one line with others; ``are_first`` says in which of them the line is the first factor.

    Their sums are made in one loop, which reads the line once for all: the same sums in the same order as apart. With
    ``in_pairs`` two products go together, as a vector; the coefficients of their other factors are kept side by side.
    """

    line: int
    products: tuple[int, ...]
    others: tuple[int, ...]
    are_first: tuple[bool, ...]
    in_pairs: bool

    @property
    def pairs(self) -> list[Pair]:
        """The other factors of products that go together."""
        return [*zip(self.others[0::2], self.others[1::2], strict=False)] if self.in_pairs else []

    @property
    def paired(self) -> tuple[int, ...]:
        """The first product of each pair."""
        return self.products[: 2 * len(self.pairs) : 2]

    @property
    def sums(self) -> dict[int, str]:
        """What the loop leaves of each product."""
        count = 2 * len(self.pairs)
        found = {i: f"sum{self.products[n - n % 2]}[{n % 2}]" for n, i in enumerate(self.products[:count])}
        return found | {i: f"low{i} + high{i}" for i in self.products[count:]}

    def begun(self, names: dict[Pair, str]) -> Iterator[str]:
        """Begin the sums, as `hs_product` does; ``names`` are those of arrays of pairs."""
        half = f"l{self.line}[k / 2]"
        for i, other, is_first in self._apart:
            middle = _term(half, f"l{other}[k / 2]", is_first)
            yield f"hs_real low{i} = HS_ALL(0.0), high{i} = k % 2 ? HS_ALL(0.0) : {middle};"
        if not self.pairs:
            return
        yield f"hs_pair {', '.join(f'low{i} = {{0.0, 0.0}}, high{i} = {{0.0, 0.0}}' for i in self.paired)};"
        yield "if (k % 2 == 0) {"
        yield f"  const hs_pair half = {{{half}, {half}}};"
        for n, (i, pair) in enumerate(zip(self.paired, self.pairs, strict=True)):
            yield f"  const hs_pair middle{i} = half * {names[pair]}[k / 2];"
            for m, is_first in enumerate(self.are_first[2 * n : 2 * n + 2]):
                yield f"  {'high' if is_first else 'low'}{i}[{m}] = middle{i}[{m}];"
        yield "}"

    def added(self, names: dict[Pair, str]) -> Iterator[str]:
        """Add two terms to each sum."""
        early, late = f"early{self.line}", f"late{self.line}"
        yield f"const hs_real {early} = l{self.line}[j], {late} = l{self.line}[k - j];"
        for i, other, is_first in self._apart:
            terms = [_term(early, f"l{other}[k - j]", is_first), _term(late, f"l{other}[j]", is_first)]
            low, high = terms if is_first else reversed(terms)
            yield f"low{i} = low{i} + {low}, high{i} = high{i} + {high};"
        if self.pairs:
            yield f"const hs_pair {early}s = {{{early}, {early}}}, {late}s = {{{late}, {late}}};"
        for i, pair in zip(self.paired, self.pairs, strict=True):
            kept = names[pair]
            yield f"low{i} = low{i} + {early}s * {kept}[k - j], high{i} = high{i} + {late}s * {kept}[j];"

    @property
    def _apart(self) -> Iterator[tuple[int, int, bool]]:
        each = zip(self.products, self.others, self.are_first, strict=True)
        return (product for n, product in enumerate(each) if n >= 2 * len(self.pairs))


def _term(own: str, other: str, is_first: bool) -> str:
    return f"{own} * {other}" if is_first else f"{other} * {own}"


def shared(tape: Tape, lines: range, first: int, in_pairs: bool) -> list[Shared]:
    """Products that share a factor, of lines that are known before the first of them; the largest groups first."""
    groups: dict[int, list[tuple[int, int, bool]]] = {}
    for i in lines:
        operation = tape.operations[i - first]
        if operation.kind == "mul" and operation.degree is None and len(set(operation.lines)) > 1:
            one, other = operation.lines
            groups.setdefault(one, []).append((i, other, True))
            groups.setdefault(other, []).append((i, one, False))
    found: list[Shared] = []
    taken: set[int] = set()
    for line, products in sorted(groups.items(), key=lambda group: -len(group[1])):
        free = [each for each in products if each[0] not in taken]
        while free:
            part = [each for each in free if each[1] < free[0][0]][: 2 * PAIRS_TOGETHER if in_pairs else TOGETHER]
            free = [each for each in free if each not in part]
            if len(part) > 1:
                products_of, others, are_first = zip(*part, strict=True)
                found.append(Shared(line, products_of, others, are_first, in_pairs))
                taken.update(products_of)
    return found


def arrays(groups: Sequence[Shared]) -> dict[Pair, str]:
    """Names of arrays for the pairs of groups."""
    pairs = dict.fromkeys(pair for group in groups for pair in group.pairs)
    return {pair: f"pairs{n}" for n, pair in enumerate(pairs)}


def statements(groups: Sequence[Shared], newest: Callable[[int], str]) -> dict[int, tuple[list[str], list[str]]]:
    """By the product before which they stand, what keeps pairs' newest coefficients at ``@``, and a loop of sums."""
    names, kept = arrays(groups), set[Pair]()
    found: dict[int, tuple[list[str], list[str]]] = {}
    for bundle in _bundles(groups):
        new = [pair for pair in dict.fromkeys(pair for group in bundle for pair in group.pairs) if pair not in kept]
        kept.update(new)
        keeping = [f"{names[a, b]}[@] = (hs_pair){{{newest(a)}, {newest(b)}}};" for a, b in new]
        loop = [
            *(line for group in bundle for line in group.begun(names)),
            "for (int j = (k - 1) / 2; j >= 0; j--) {",
            *(f"  {line}" for group in bundle for line in group.added(names)),
            "}",
            *(f"const hs_pair sum{i} = low{i} + high{i};" for group in bundle for i in group.paired),
        ]
        found[bundle[0].products[0]] = keeping, loop
    return found


def _bundles(groups: Sequence[Shared]) -> list[list[Shared]]:
    """Groups whose sums one loop makes: their factors are known before the first product of the first."""
    bundles: list[list[Shared]] = []
    for group in sorted(groups, key=lambda group: group.products[0]):
        for bundle in bundles:
            known = max(group.line, *group.others) < bundle[0].products[0]
            together = sum(len(each.products) for each in (*bundle, group))
            if known and together <= (2 * PAIRS_TOGETHER if group.in_pairs else TOGETHER):
                bundle.append(group)
                break
        else:
            bundles.append([group])
    return bundles
