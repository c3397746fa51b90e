"""Many runs of one model at once: their results as arrays, and as pandas DataFrames.

A DataFrame has a row for each run, each sample, or each transition.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.base.names import called, checks_methods, visible, without_memory
from hsdsl.engine.execution.records import COMPLETE, Array, optional, shown
from hsdsl.engine.execution.run import Execution


@dataclass(frozen=True)
class Failure:
    """An instance that did not reach its end.

    ``reason`` is one of `execution.REASONS`, or ``refused`` if it could not be started. ``message`` is the reason as a
    sentence.
    """

    index: tuple[int, ...]
    reason: str
    message: str


@dataclass(frozen=True, eq=False)
class TransitionTable:
    """Every transition of an ensemble's instances, ordered by instance and then by time.

    Attributes
    ----------
    first : array of int, shape (instances + 1,)
        The index of the first transition of each instance (in the order of the flattened arrays); the last element is
        the end.
    time, edge, entry : array, shape (transitions,)
        The time and the name of each transition, and whether it fired at once on entry to its mode.
    before, after : dict of array, shape (transitions,)
        States by name; not-a-number if the mode lacks the state, and after a transition in which a run ended.
    """

    first: Array
    time: Array
    edge: Array
    entry: Array
    before: dict[str, Array]
    after: dict[str, Array]

    def of(self, instance: int) -> slice:
        """Return the slice of the transitions of an instance."""
        return slice(int(self.first[instance]), int(self.first[instance + 1]))


@checks_methods
@dataclass(frozen=True, eq=False)
class Ensemble:
    """The runs of an ensemble. The shape of every array begins with :attr:`shape`, the common shape of the varied
    values.

    Attributes
    ----------
    varied : dict
        The varied values of parameters, and of initial states as ``initial.NAME``.
    stop : array of str
        The reason of each run's end: one of `execution.REASONS`; ``refused`` if an instance could not be
        started, ``interrupted`` if Ctrl-C came first.
    time : array of float
        The time of its end (not-a-number if it was not run).
    mode : array of str
        The mode at the end; empty if it was not run.
    state, outputs : dict of array
        The values at the end by name; not-a-number if the mode lacks the state.
    transitions : array of int
        The number of transitions.
    warnings : array of str
        The codes of the runs' own warnings (`errors.WARNINGS`), separated by spaces; empty if there are none.
        They concern walls that were not checked, motion along guards, limits of accumulating transitions, sliding, and
        waits in strips; and ranges of `initial` of which the runs take the centre (``HS707``). The other codes need a
        verdict: ``ensemble.run(...).warnings``.
    transition_times : array, shape (..., n)
        The times of the first n transitions, for a positive n; not-a-number if fewer were made.
    sample_times : array, shape (..., n)
    samples : dict of array, shape (..., n)
        The states and outputs at these times by name; not-a-number beyond a run's end; empty without sample times.
    transition_table : TransitionTable or None
        Every transition, if they were kept.
    units : mapping
        The units of states, of outputs, and of time by ``t``, for pictures.
    """

    model: str
    digest: str
    engine: str
    scheme: str
    method: str
    shape: tuple[int, ...]
    varied: dict[str, Array]
    stop: Array
    time: Array
    mode: Array
    state: dict[str, Array]
    outputs: dict[str, Array]
    transitions: Array
    warnings: Array
    transition_times: Array
    sample_times: Array
    samples: dict[str, Array]
    seconds: dict[str, float]
    refusals: Mapping[tuple[int, ...], str]
    transition_table: TransitionTable | None = field(repr=False)
    again: Callable[[tuple[int, ...]], Execution] = field(repr=False)
    title: str | None = None
    units: Mapping[str, str] = field(default_factory=dict[str, str], repr=False)

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {reason}" for reason, count in self.reasons.items())
        how = f"{self.scheme} {self.method}, shape {self.shape}"
        return f"<Ensemble of {visible(called(self.title, self.model))}: {how}, stops: {counts or 'none'}>"

    def _repr_html_(self) -> str:
        """Show the varied values, the ends of the runs, and a picture in notebooks."""
        return shown("ensemble_html", self)

    def plot(
        self,
        path: str | os.PathLike[str],
        columns: Sequence[str] | None = None,
        *,
        shares: Sequence[float] = (0.5, 0.9),
    ) -> None:
        """Draw samples over time to a .png or .svg file: the median, and bands that hold shares of the runs.

        Parameters
        ----------
        path : path
        columns : sequence of str, optional
            States and outputs; by default all of :attr:`samples`.
        shares : sequence of float
            Shares between 0 and 1. A band of the share 0.9 is between the quantiles 0.05 and 0.95 of those runs that
            have a number at the time.

        Raises UsageError: no samples, sample times that differ, an unknown column, or no share.
        """
        shown("ensemble_plot", self, path, columns, shares)

    def to_pandas(self, what: Literal["runs", "samples", "transitions"] = "runs") -> Any:
        """Make a pandas DataFrame with a row for each run, each sample, or each transition.

        Parameters
        ----------
        what : {"runs", "samples", "transitions"}
            ``runs``: the varied values, ``stop``, ``time``, ``mode``, final states and outputs, ``transitions``,
            ``warnings``, and ``transition_0``, ... where times were kept. ``samples``: the varied values, ``time``, and
            values then. ``transitions``: the varied values, ``time``, ``edge``, and ``before.NAME`` and ``after.NAME``
            of each state. A state or output of the name of another column is ``state.NAME`` or ``output.NAME``.

        Returns
        -------
        DataFrame
            Its index is the instance, by one number for each dimension of :attr:`shape`.

        Raises UsageError: pandas is not installed, or the ensemble has kept no samples or transitions.
        """
        return frame(self, what)

    @property
    def reasons(self) -> dict[str, int]:
        """The number of instances for each reason of the end."""
        found, counts = np.unique(self.stop, return_counts=True)
        return dict(zip(found.tolist(), counts.tolist(), strict=True))

    @property
    def warning_counts(self) -> dict[str, int]:
        """The number of instances for each code of :attr:`warnings`."""
        return dict(sorted(Counter(" ".join(self.warnings.ravel().tolist()).split()).items()))

    @property
    def failed(self) -> Array:
        """Whether each instance failed to reach its end: array of bool."""
        return ~np.isin(self.stop, COMPLETE)

    def failures(self, most: int = 100) -> tuple[Failure, ...]:
        """Name the first failed instances; each is run again for its message.

        Parameters
        ----------
        most : int
            The largest number of instances to name.
        """
        places = [tuple(map(int, place)) for place in np.argwhere(self.failed)[:most]]
        return tuple(self._failure(place) for place in places)

    def _failure(self, place: tuple[int, ...]) -> Failure:
        reason = str(self.stop[place])
        if reason == "refused":
            return Failure(place, reason, self.refusals[place])
        if reason == "interrupted":
            return Failure(place, reason, "the ensemble was interrupted before this instance was run to its end")
        return Failure(place, reason, self.run(*place).stop.message)

    def run(self, *index: int) -> Execution:
        """Run one instance again, and return the whole execution.

        Raises IndexError: there is no such instance.
        """
        if len(index) != len(self.shape) or any(not -n <= i < n for i, n in zip(index, self.shape, strict=True)):
            raise IndexError(f"expected an index of an ensemble of shape {self.shape}, got {index}")
        return self.again(tuple(i % n for i, n in zip(index, self.shape, strict=True)))


def frame(ensemble: Ensemble, what: str) -> Any:
    """Make the table; see `Ensemble.to_pandas`."""
    makers = {"runs": _runs, "samples": _samples, "transitions": _transitions}
    if what not in makers:
        raise UsageError(f"expected {', '.join(makers)}, got {what!r}")
    pandas = optional("pandas", "a DataFrame")
    instances, columns = makers[what](ensemble)
    return pandas.DataFrame(columns, index=_index(pandas, ensemble.shape, instances))


def _index(pandas: Any, shape: tuple[int, ...], instances: Array) -> Any:
    places: Any = np.unravel_index(instances, shape) if shape else [instances]
    if len(places) == 1:
        return pandas.Index(places[0], name="instance")
    return pandas.MultiIndex.from_arrays(places, names=[f"instance_{k}" for k in range(len(places))])


def _labelled(taken: Iterable[str], ensemble: Ensemble, values: dict[str, Array]) -> dict[str, Array]:
    """Columns of states and outputs, with their kind before a name that is taken."""
    names = set(taken)
    kind = {name: "state" if name in ensemble.state else "output" for name in values}
    return {f"{kind[name]}.{name}" if name in names else name: column for name, column in _seen(values)}


def _varied(ensemble: Ensemble, instances: Array) -> dict[str, Array]:
    return {
        name: np.broadcast_to(values, ensemble.shape).ravel()[instances] for name, values in ensemble.varied.items()
    }


def _seen(columns: dict[str, Array]) -> list[tuple[str, Array]]:
    return [(name, columns[name]) for name in without_memory(columns)]


def _runs(ensemble: Ensemble) -> tuple[Array, dict[str, Array]]:
    instances = np.arange(ensemble.stop.size)
    times = ensemble.transition_times.reshape(len(instances), -1)
    known = {name: getattr(ensemble, name) for name in ("stop", "time", "mode", "transitions", "warnings")}
    columns = _varied(ensemble, instances) | {name: values.ravel() for name, values in known.items()}
    columns |= {f"transition_{k}": times[:, k] for k in range(times.shape[1])}
    ends = {name: values.ravel() for name, values in (ensemble.state | ensemble.outputs).items()}
    return instances, columns | _labelled(columns, ensemble, ends)


def _samples(ensemble: Ensemble) -> tuple[Array, dict[str, Array]]:
    if not ensemble.samples:
        raise UsageError("the ensemble has no samples", "give samples=300 to `ensemble`")
    count = ensemble.stop.size
    times = np.broadcast_to(ensemble.sample_times, next(iter(ensemble.samples.values())).shape).reshape(count, -1)
    instances = np.repeat(np.arange(count), times.shape[1])
    columns = _varied(ensemble, instances) | {"time": times.ravel()}
    return instances, columns | _labelled(columns, ensemble, {k: v.ravel() for k, v in ensemble.samples.items()})


def _transitions(ensemble: Ensemble) -> tuple[Array, dict[str, Array]]:
    table = ensemble.transition_table
    if table is None:
        raise UsageError("the ensemble has kept no transitions", "give every_transition=True to model.ensemble")
    instances = np.repeat(np.arange(len(table.first) - 1), np.diff(table.first))
    columns = _varied(ensemble, instances) | {"time": table.time, "edge": table.edge, "entry": table.entry}
    columns |= {f"before.{name}": values for name, values in _seen(table.before)}
    return instances, columns | {f"after.{name}": values for name, values in _seen(table.after)}
