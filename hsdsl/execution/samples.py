"""Values of an execution at many points, by column."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy.typing as npt

from hsdsl.errors import UsageError

Array = npt.NDArray[Any]

# The first three columns of every table; a state or output of such a name is labelled `state.j`, `output.j`.
HYBRID_TIME = ("time", "mode", "j")


@dataclass(frozen=True, eq=False)
class Samples:
    """Values of an execution at n points of hybrid time, by column.

    Attributes
    ----------
    time, mode, jump, kind : array, shape (n,)
        Time, name of the mode, transitions made so far, and ``flow`` or ``strip``.
    states, outputs : tuple of str
        Names, in the order in which the execution first has them.
    state_columns, output_columns : array, shape (n, number of names)
        Values, NaN where the mode lacks the state (or a state that the output needs).
    present : array of bool, shape (n, number of states)
        Whether the mode has the state, so that a state that *is* NaN can be told from one that is not there.

    ``samples["x"]`` is the column of a state or output, shape (n,); ``len(samples)`` is n.
    """

    time: Array
    mode: Array
    jump: Array
    kind: Array
    states: tuple[str, ...]
    outputs: tuple[str, ...]
    state_columns: Array
    output_columns: Array
    present: Array

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, name: str) -> Array:
        if name in self.states:
            return self.state_columns[:, self.states.index(name)]
        if name in self.outputs:
            return self.output_columns[:, self.outputs.index(name)]
        raise KeyError(f"no state or output is called {name}; there are {', '.join(self.names) or 'none'}")

    @property
    def names(self) -> tuple[str, ...]:
        """All states, then all outputs."""
        return self.states + self.outputs

    @property
    def labels(self) -> tuple[str, ...]:
        """What heads the columns of a table: ``time``, ``mode``, ``j``, states, outputs."""
        states = [f"state.{name}" if name in HYBRID_TIME else name for name in self.states]
        outputs = [f"output.{name}" if name in HYBRID_TIME else name for name in self.outputs]
        return (*HYBRID_TIME, *states, *outputs)

    def columns(self) -> Iterator[tuple[str, Array, Array | None]]:
        """Give each column of the table: label, values (n,), and where it has a value (None: everywhere)."""
        values = [self.time, self.mode, self.jump, *self.state_columns.T, *self.output_columns.T]
        computed = [column == column for column in self.output_columns.T]
        present = [None, None, None, *self.present.T, *computed]
        yield from zip(self.labels, values, present, strict=True)

    def to_pandas(self) -> Any:
        """Make a pandas DataFrame of the table's columns.

        Raises
        ------
        UsageError
            When pandas is not installed.
        """
        pandas = optional("pandas", "a DataFrame")
        return pandas.DataFrame({label: values for label, values, _ in self.columns()})


def optional(library: str, what: str) -> Any:
    """Import a library of the ``table`` extra, or say how to get it."""
    try:
        return import_module(library)
    except ImportError:
        message = f"{what} needs {library}, which is not installed: pip install 'hsdsl[table]'"
        raise UsageError(message) from None
