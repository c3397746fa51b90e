"""Products of a tape that share a factor: their sums in one loop, as the derivatives of a product have them."""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.program import Tape

TOGETHER = 6  # products in a loop: their sums and two factors are in registers


@dataclass(frozen=True)
class Shared:
    """Products of one line with others, each of which is the first factor or the second.

    Their sums are made in one loop, which reads the line once for all: the same sums in the same order as apart.
    """

    line: int
    products: tuple[int, ...]
    others: tuple[int, ...]
    is_first: bool

    def loop(self) -> list[str]:
        """The statements of the sums ``low`` and ``high``, as in `hs_product`."""
        own, pairs = f"l{self.line}", list(zip(self.products, self.others, strict=True))
        middle = {i: self._term(f"{own}[k / 2]", f"l{other}[k / 2]") for i, other in pairs}
        body = list[str]()
        for i, other in pairs:
            terms = [self._term("early", f"l{other}[k - j]"), self._term("late", f"l{other}[j]")]
            low, high = terms if self.is_first else reversed(terms)
            body.append(f"  low{i} = low{i} + {low}, high{i} = high{i} + {high};")
        return [
            *(f"hs_real low{i} = 0.0, high{i} = k % 2 ? 0.0 : {middle[i]};" for i, _ in pairs),
            f"for (int j = (k - 1) / 2; j >= 0; j--) {{ const hs_real early = {own}[j], late = {own}[k - j];",
            *body,
            "}",
        ]

    def _term(self, own: str, other: str) -> str:
        return f"{own} * {other}" if self.is_first else f"{other} * {own}"


def shared(tape: Tape, lines: range, first: int) -> list[Shared]:
    """Products that share a factor, of lines that are known before the first of them; the largest groups first."""
    groups: dict[tuple[int, bool], list[tuple[int, int]]] = {}
    for i in lines:
        operation = tape.operations[i - first]
        if operation.kind == "mul" and operation.degree is None:
            one, other = operation.lines
            groups.setdefault((one, True), []).append((i, other))
            groups.setdefault((other, False), []).append((i, one))
    found: list[Shared] = []
    taken: set[int] = set()
    for (line, is_first), products in sorted(groups.items(), key=lambda group: -len(group[1])):
        free = [(i, factor) for i, factor in products if i not in taken]
        while free:
            part = [each for each in free if each[1] < free[0][0]][:TOGETHER]
            free = [each for each in free if each not in part]
            if len(part) > 1:
                found.append(Shared(line, tuple(i for i, _ in part), tuple(f for _, f in part), is_first))
                taken.update(i for i, _ in part)
    return found
