"""Which states the arcs of a compiled run have: each distinct tuple of states is one kind."""

from __future__ import annotations

import numpy as np

from hsdsl.engine.execution import Array
from hsdsl.mathematics.program import Program

MOST_ARCS, MOST_KEPT = 256, 64


class StateLayouts:
    """The kinds of arcs of all runs of a program that begin with the same states.

    Attributes
    ----------
    kinds : tuple of tuples of str
        The first is what runs begin with.
    of_mode : array of int32, shape (modes,)
        The kind of each mode's arcs; -1 for a final mode without a flow, which keeps the states it is entered with.
    """

    def __init__(self, program: Program, states: tuple[str, ...]) -> None:
        own = [None if mode.final and not mode.states else mode.states for mode in program.modes]
        self.kinds = tuple(dict.fromkeys((states, *(kind for kind in own if kind is not None))))
        self.of_mode = np.array([-1 if kind is None else self.kinds.index(kind) for kind in own], np.int32)
        self._kept: dict[bytes, tuple[Array, tuple[str, ...]]] = {}

    @property
    def one(self) -> bool:
        """Whether all arcs are of one kind."""
        return len(self.kinds) == 1

    def of_arcs(self, modes: Array, before: int = 0) -> Array:
        """Give the kind of each arc by its mode, the one before them being of kind ``before``."""
        found = self.of_mode[modes]
        for i in np.flatnonzero(found < 0):
            found[i] = found[i - 1] if i else before
        return found

    def found(self, modes: Array) -> tuple[Array, tuple[str, ...]]:
        """Give the kind of each arc, and the names of all their states in the order in which they come up.

        The last few answers are kept: runs of one model often pass through the same modes.
        """
        if len(modes) > MOST_ARCS:
            return self._found(modes)
        key = modes.tobytes()
        if key not in self._kept:
            if len(self._kept) >= MOST_KEPT:
                self._kept.clear()
            self._kept[key] = self._found(modes)
        return self._kept[key]

    def _found(self, modes: Array) -> tuple[Array, tuple[str, ...]]:
        found = self.of_arcs(modes)
        numbers: list[int] = found.tolist()
        order = dict.fromkeys(numbers)
        return found, tuple(dict.fromkeys(name for kind in order for name in self.kinds[kind]))

    def width(self, found: Array) -> int:
        """Return the most states that arcs of these kinds have."""
        numbers: list[int] = found.tolist()
        return max(len(self.kinds[kind]) for kind in set(numbers))
