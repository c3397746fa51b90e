"""Values of an execution at many points, by column."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy.typing as npt

from hsdsl.base.errors import UsageError
from hsdsl.base.names import checks_methods, did_you_mean
from hsdsl.engine.execution.records import Deferred

Array = npt.NDArray[Any]

# The first three columns of every table; a state or output of such a name is labelled `state.j`, `output.j`.
HYBRID_TIME = ("time", "mode", "j")


@checks_methods
@dataclass(frozen=True, eq=False)
class Samples(Deferred):
    """Values of an execution at n points of hybrid time, by column.

    Attributes
    ----------
    time, mode, jump, kind : array, shape (n,)
        Time, name of the mode, transitions made so far, and ``flow`` or ``strip``.
    states, outputs : tuple of str
        Names, in the order in which the execution first has them.
    state_columns, output_columns : array, shape (n, number of names)
        Values, NaN where the mode lacks the state (or does not define the output).
    present : array of bool, shape (n, number of states)
        Whether the mode has the state, so that a state that *is* NaN differs from an absent one.

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

    def only(self, columns: Sequence[str] | None) -> Samples:
        """Keep only the states and outputs named, in the order named (states before outputs).

        Raises UsageError: for a name that is neither a state nor an output; the closest one is suggested.
        """
        if columns is None:
            return self
        chosen_states, chosen_outputs = split(columns, self.states, self.outputs)
        states = [self.states.index(name) for name in chosen_states]
        outputs = [self.outputs.index(name) for name in chosen_outputs]
        return replace(
            self,
            states=chosen_states,
            outputs=chosen_outputs,
            state_columns=self.state_columns[:, states],
            output_columns=self.output_columns[:, outputs],
            present=self.present[:, states],
        )

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

        Raises UsageError: when pandas is not installed.
        """
        pandas = optional("pandas", "a DataFrame")
        return pandas.DataFrame({label: values for label, values, _ in self.columns()})


def split(
    columns: Sequence[str], states: tuple[str, ...], outputs: tuple[str, ...]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Sort names of columns into those of states and those of outputs, each once.

    Raises UsageError: for a name that is neither; the closest one is suggested.
    """
    return _split(tuple(map(str, columns)), states, outputs)


@lru_cache(64)
def _split(
    columns: tuple[str, ...], states: tuple[str, ...], outputs: tuple[str, ...]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    known = states + outputs
    for name in columns:
        if name not in known:
            hint = did_you_mean(name, known) or "there are none"
            raise UsageError(f"no state or output is called {name}", hint=hint)
    named = dict.fromkeys(columns)
    return tuple(name for name in named if name in states), tuple(name for name in named if name not in states)


def optional(library: str, what: str, extra: str = "table") -> Any:
    """Import a library of an extra, or say how to get it."""
    try:
        return import_module(library)
    except ImportError:
        package = library.partition(".")[0]
        message = f"{what} needs {package}, which is not installed: pip install 'hsdsl[{extra}]', or {package} alone"
        raise UsageError(message) from None
