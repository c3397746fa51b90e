"""Products of a tape that share a factor: their sums in one loop, as the derivatives of a product have them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from hsdsl.mathematics.program import Tape

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
            yield f"hs_real low{i} = 0.0, high{i} = k % 2 ? 0.0 : {_term(half, f'l{other}[k / 2]', is_first)};"
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
