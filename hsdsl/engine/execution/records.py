"""What an execution is made of: arcs, transitions, how it stopped, what may be said about it, and samples of it.

Records are frozen dataclasses, with fields that may be made on first use, and equality by value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import lru_cache
from importlib import import_module
from itertools import chain
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, Self, TypeVar, cast, overload

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.base.names import checks_methods, did_you_mean


class Deferred:
    """A frozen dataclass that may compute some of its fields at first use; users do not notice the difference.

    A run of a tenth of a millisecond would else spend several times that on tables that few look at.
    """

    @classmethod
    def deferred(
        cls, later: Mapping[str, Callable[[Any], Any]], known: Mapping[str, Any] = MappingProxyType({}), **now: Any
    ) -> Self:
        """Make an object from the values of some fields, and from functions of the object for the other fields.

        Nothing is checked. ``known`` is what many have in common.
        """
        return cls.of_fields({**known, **now, "_later": later})

    @classmethod
    def of_fields(cls, fields: dict[str, Any]) -> Self:
        """Make an object of what `deferred` makes one of, in one dictionary, which becomes its own."""
        made = object.__new__(cls)
        object.__setattr__(made, "__dict__", fields)
        return made

    def _elsewhere(self, name: str) -> str:
        """Return a hint where to find the value of a public name that is no attribute."""
        return ""

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            make = self.__dict__.get("_later", {}).get(name)
            if make is None:
                hint = self._elsewhere(name) if self.__dict__ and not name.startswith("_") else ""
                raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'{hint}")
            value = self.__dict__[name] = make(self)
            return value

    def __dir__(self) -> list[str]:
        """List the public names: fields, computed or deferred, properties and methods."""
        own = {field.name for field in fields(self)}  # pyright: ignore[reportArgumentType]
        names = own.union(dir(type(self))) - {"deferred"}
        return sorted(name for name in names if not name.startswith("_"))

    def __getstate__(self) -> dict[str, Any]:
        """Return every field; the functions that compute deferred fields are not pickled."""
        return {field.name: getattr(self, field.name) for field in fields(self)}  # pyright: ignore[reportArgumentType]


# how runs show and save themselves: functions of the analysis; their data does not import its pictures
HOMES = {
    "axes": "hsdsl.analysis.plot",
    "ensemble_html": "hsdsl.analysis.plot.notebook",
    "ensemble_plot": "hsdsl.analysis.plot.ensembles",
    "run_html": "hsdsl.analysis.plot.notebook",
    "save": "hsdsl.analysis.store",
}


def shown(name: str, *given: Any, **options: Any) -> Any:
    """Call the function of this name, imported where it is called."""
    return getattr(import_module(HOMES[name]), name)(*given, **options)


def same(a: Any, b: Any) -> bool:
    """Compare numbers, texts, arrays, dataclasses and containers by value.

    Arrays must agree in shape and in kind of number (float64 or object), containers in kind and order; fields
    marked ``compare=False`` are left out.
    """
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return _same_arrays(a, b)
    if is_dataclass(a) or is_dataclass(b):
        return type(a) is type(b) and all(
            same(getattr(a, field.name), getattr(b, field.name)) for field in fields(a) if field.compare
        )
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        left, right = cast(Mapping[Any, Any], a), cast(Mapping[Any, Any], b)
        return list(left) == list(right) and all(same(left[key], right[key]) for key in left)
    if isinstance(a, (tuple, list, Records)) and isinstance(b, (tuple, list, Records)):
        left, right = cast("Sequence[Any]", a), cast("Sequence[Any]", b)
        return (
            isinstance(a, list) == isinstance(b, list)
            and len(left) == len(right)
            and all(same(x, y) for x, y in zip(left, right, strict=True))
        )
    return bool(a == b) or (bool(a != a) and bool(b != b))  # not-a-number alone differs from itself


def _same_arrays(a: Any, b: Any) -> bool:
    if not (isinstance(a, np.ndarray) and isinstance(b, np.ndarray)):
        return False
    left, right = cast("np.ndarray[Any, Any]", a), cast("np.ndarray[Any, Any]", b)
    if left.shape != right.shape or (left.dtype == object) != (right.dtype == object):
        return False
    with np.errstate(invalid="ignore"):
        equal = np.asarray(left == right, dtype=bool)
        nan = np.asarray(left != left, dtype=bool) & np.asarray(right != right, dtype=bool)
    return bool(np.all(equal | nan))


Item = TypeVar("Item")
BLOCK, MOST_BLOCKS = 128, 256  # records that are made together, and how often these are kept


class Records(Sequence[Item]):
    """A tuple of so many records, but made where they are looked at: those of a long run take more than its columns.

    ``make`` gives those from one number up to another. The blocks that were looked at last are kept.
    """

    def __init__(self, count: int, make: Callable[[int, int], Iterable[Item]]) -> None:
        self._count, self._make = count, make
        self._blocks: dict[int, list[Item]] = {}

    def _block(self, number: int) -> list[Item]:
        found = self._blocks.get(number)
        if found is None:
            if len(self._blocks) >= MOST_BLOCKS:
                self._blocks.pop(next(iter(self._blocks)), None)
            start = number * BLOCK
            found = self._blocks[number] = list(self._make(start, min(start + BLOCK, self._count)))
        return found

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> Item: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Item, ...]: ...
    def __getitem__(self, index: int | slice) -> Any:
        if isinstance(index, slice):
            return tuple(self[place] for place in range(self._count)[index])
        place = range(self._count)[index]
        return self._block(place // BLOCK)[place % BLOCK]

    def __iter__(self) -> Iterator[Item]:
        return chain.from_iterable(map(self._block, range(-(-self._count // BLOCK))))

    def __add__(self, other: tuple[Item, ...]) -> tuple[Item, ...]:
        return (*self, *other)

    def __radd__(self, other: tuple[Item, ...]) -> tuple[Item, ...]:
        return (*other, *self)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, (tuple, Records)):
            return NotImplemented
        there = cast("Sequence[Item]", other)
        return len(self) == len(there) and all(a == b for a, b in zip(self, there, strict=True))

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return repr(tuple(self))

    def __reduce__(self) -> tuple[Any, ...]:
        return tuple, (tuple(self),)


Kind = Literal["flow", "strip"]


@dataclass(frozen=True)
class Arc:
    """Rows ``first..last`` (inclusive) of an execution, in one mode, with one jump counter."""

    mode: str
    states: tuple[str, ...]
    kind: Kind
    jump: int
    first: int
    last: int


@dataclass(frozen=True)
class Transition:
    """A transition that a run made.

    ``time`` is the time at which the guard was reached, ``resumed`` that at which the flow continued. If the run ended
    in the strip, ``resumed`` and ``after`` are None. ``alternatives`` are the edges reached within the tie tolerance
    and not taken. ``entry`` says that the transition fired at once because the state entered its mode beyond the
    surface.
    """

    index: int
    time: Any
    resumed: Any | None
    edge: str
    source: str
    target: str
    before: dict[str, Any]
    after: dict[str, Any] | None
    alternatives: tuple[str, ...]
    entry: bool = False


@dataclass(frozen=True)
class Stop:
    """The reason and time of a run's end.

    Attributes
    ----------
    reason : str
        ``until`` or ``final``; ``left_domain`` or ``zeno``, at which the execution itself ends; ``transition_limit``,
        ``waiting_limit``, ``memory_limit``, ``not_finite``, ``step_underflow`` or ``interrupted``.
    time : number
        The time of the end.
    message : str
        The reason as a sentence.
    """

    reason: str
    time: Any
    message: str

    @property
    def complete(self) -> bool:
        """Whether the run reached its end (exit code 0)."""
        return self.reason in COMPLETE


COMPLETE = ("until", "final")  # the run got to where it was going
LEFT = ("left_domain", "zeno")  # the execution itself ends there
INCOMPLETE = ("transition_limit", "waiting_limit", "memory_limit", "not_finite", "step_underflow", "interrupted")
REASONS = (*COMPLETE, *LEFT, *INCOMPLETE)


@dataclass(frozen=True)
class RunWarning(Deferred):
    """A warning about a run, which is reported before its verdict.

    Attributes
    ----------
    code : str
        One of `hsdsl.base.errors.WARNINGS`; `hsdsl explain CODE` prints its page.
    time : number or None
        When it was first so.
    edge : str or None
        The transition that it is about.
    message : str
        The reason as a sentence.
    """

    code: str
    time: Any | None
    edge: str | None
    message: str


@dataclass(frozen=True)
class Verdict(Deferred):
    """Whether the theorem's hypotheses hold for a run: ``holds``, ``left`` or ``unknown``.

    ``reasons`` has all reasons; ``warnings`` has the warnings found with the verdict.
    """

    theorem: Literal["holds", "left", "unknown"]
    reasons: tuple[str, ...]
    warnings: tuple[RunWarning, ...] = field(default_factory=tuple[RunWarning, ...])


@dataclass(frozen=True)
class Point:
    """The value of an execution at one time. ``state`` and ``outputs`` are keyed by name; indexing accepts both."""

    time: Any
    mode: str
    jump: int
    kind: Kind
    state: dict[str, Any]
    outputs: dict[str, Any]

    def __getitem__(self, name: str) -> Any:
        return self.state[name] if name in self.state else self.outputs[name]


Array = np.ndarray[tuple[Any, ...], np.dtype[Any]]

# The first three columns of every table; a state or output of such a name is labelled `state.j`, `output.j`.
HYBRID_TIME = ("time", "mode", "j")


@checks_methods
@dataclass(frozen=True, eq=False)
class Samples(Deferred):
    """The values of an execution at n points of hybrid time, by column.

    Attributes
    ----------
    time, mode, jump, kind : array, shape (n,)
        Time, name of the mode, transitions made so far, and ``flow`` or ``strip``.
    states, outputs : tuple of str
        Names, in the order of their first occurrence in the execution.
    state_columns, output_columns : array, shape (n, number of names)
        Values; NaN if the mode lacks the state (or does not define the output).
    present : array of bool, shape (n, number of states)
        Whether the mode has the state; this distinguishes a state that *is* NaN from an absent one.

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

    def at(self, rows: Any) -> Samples:
        """Keep only these rows, an index array, a mask or a slice."""
        by_row = ("time", "mode", "jump", "kind", "state_columns", "output_columns", "present")
        chosen = {name: getattr(self, name)[rows] for name in by_row}
        return Samples(states=self.states, outputs=self.outputs, **chosen)

    def only(self, columns: Sequence[str] | None) -> Samples:
        """Keep only the named states and outputs, in the given order (states before outputs).

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
        """The names of the columns of a table: ``time``, ``mode``, ``j``, states, outputs."""
        states = [f"state.{name}" if name in HYBRID_TIME else name for name in self.states]
        outputs = [f"output.{name}" if name in HYBRID_TIME else name for name in self.outputs]
        return (*HYBRID_TIME, *states, *outputs)

    def columns(self) -> Iterator[tuple[str, Array, Array | None]]:
        """Yield each column of the table: its label, its values (n,), and a mask of the rows with a value (None: all
        rows).
        """
        values = [self.time, self.mode, self.jump, *self.state_columns.T, *self.output_columns.T]
        computed = [column == column for column in self.output_columns.T]
        yield from zip(self.labels, values, [None, None, None, *self.present.T, *computed], strict=True)

    def to_pandas(self) -> Any:
        """Make a pandas DataFrame of the table's columns.

        Raises UsageError: when pandas is not installed.
        """
        pandas = optional("pandas", "a DataFrame")
        return pandas.DataFrame({label: values for label, values, _ in self.columns()})


def split(
    columns: Sequence[str], states: tuple[str, ...], outputs: tuple[str, ...]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Sort names of columns into names of states and names of outputs, without repetition.

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
    """Import a library of an extra, or say how to install it."""
    try:
        return import_module(library)
    except ImportError:
        package = library.partition(".")[0]
        message = f"{what} needs {package}, which is not installed: pip install 'hsdsl[{extra}]', or {package} alone"
        raise UsageError(message) from None
