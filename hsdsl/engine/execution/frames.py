"""Tables of an ensemble as pandas DataFrames: a row for each run, each sample, or each transition."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.base.names import without_memory
from hsdsl.engine.execution.samples import Array, optional

if TYPE_CHECKING:
    from hsdsl.engine.execution.ensemble import Ensemble


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
        raise UsageError("the ensemble has no samples", "give samples= to model.ensemble")
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
