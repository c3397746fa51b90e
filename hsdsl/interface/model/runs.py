"""Runs of a model, and what all that is made of runs needs: its stages, its names, derivatives, what pictures show."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial, wraps
from typing import TYPE_CHECKING, Any, Self, TypeVar, cast

from hsdsl.base.errors import UsageError
from hsdsl.base.names import checks_arguments, checks_methods, did_you_mean
from hsdsl.base.progress import in_notebook, is_notebook, running
from hsdsl.engine.execution import Execution
from hsdsl.engine.preparation.options import Options, overrides_of
from hsdsl.engine.preparation.pipeline import Pipeline
from hsdsl.engine.preparation.visible import visible_run
from hsdsl.engine.simulate import Prepared
from hsdsl.interface.model.call_cache import CallCache, call_key
from hsdsl.mathematics.program import Program

if TYPE_CHECKING:
    from hsdsl.analysis.sensitivity.result import Sensitivity
    from hsdsl.engine.integrators import ButcherTableau
    from hsdsl.engine.simulate.recorder import Progress
    from hsdsl.interface.model.differentiate import Differentiator
    from hsdsl.language.system import HybridSystem

MOST_PREPARED = 16
ELSEWHERE = {
    "parameters": "their names are model.program.parameters",
    "states": "their names are model.program.all_states, with outputs model.columns",
    "outputs": "their names are model.program.outputs",
    "inputs": "write their numbers as parameters in the file, and give these to model.simulate(parameters=...)",
    "run": "model.simulate() runs it",
}


def elsewhere(model: Runs, name: str) -> str | None:
    """Say where to give a name that is no argument of a method."""
    if name in model.program.parameters:
        return f"it is a parameter: parameters={{'{name}': ...}}"
    if name in model.program.all_states:
        return f"it is a state: initial={{'{name}': ...}}"
    return ELSEWHERE.get(name)


Call = TypeVar("Call", bound=Callable[..., Execution])


def kept(simulate: Call) -> Call:
    """Let a call that was made before run what it has kept; to bind so many arguments takes as long as a short run.

    It is found where the arguments that differ from their defaults are given in their order.
    """
    checked: Any = checks_arguments(simulate, "Model.simulate", elsewhere)

    @wraps(simulate)
    def call(self: Runs, until: Any = None, **given: Any) -> Execution:
        if until is not None:
            given = {"until": until, **given}
        ready = self.kept_runs.find(call_key(*given, *given.values()))
        if ready is None or is_notebook():
            return checked(self, **given)
        return visible_run(ready.simulate(None, self.pipeline.seconds), ready)

    return cast("Call", call)


@partial(checks_methods, elsewhere=elsewhere, name="Model")
class Runs:
    """A checked model as far as it runs; see `Model`."""

    def __init__(self, of: HybridSystem | Pipeline) -> None:
        self.pipeline = of if isinstance(of, Pipeline) else Pipeline(of)
        self._smaller: dict[tuple[str, ...], Self] = {}
        self.kept_runs: CallCache[Prepared] = CallCache(MOST_PREPARED)

    @cached_property
    def _differentiator(self) -> Differentiator:
        from hsdsl.interface.model.differentiate import Differentiator

        return Differentiator(self.pipeline)

    def __reduce__(self) -> tuple[type[Self], tuple[Pipeline]]:
        return type(self), (self.pipeline,)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            try:
                return object.__getattribute__(self, name)
            except AttributeError as error:
                raise AttributeError(f"{error}{'; ' * (name in ELSEWHERE)}{ELSEWHERE.get(name, '')}") from None

    @property
    def system(self) -> HybridSystem:
        """The mathematics; a cached model elaborates it at the first use."""
        return self.pipeline.system

    @property
    def program(self) -> Program:
        """The model lowered to routines, free of SymPy."""
        return self.pipeline.program

    @property
    def columns(self) -> list[str]:
        """Names of all states and outputs."""
        return self.pipeline.columns

    def resolve(self, settings: Mapping[str, Any] | None = None, call: Mapping[str, Any] | None = None) -> Options:
        """Resolve the options of the file, of ``settings`` and of a call (see `hsdsl.engine.preparation.options`)."""
        return self.pipeline.resolve(settings, call)

    @kept
    def simulate(
        self,
        until: Any = None,
        *,
        scheme: str | None = None,
        method: str | ButcherTableau | None = None,
        step: Any = None,
        tolerance: Any = None,
        relaxation: Any = None,
        scale: Mapping[str, Any] | None = None,
        samples: Any = None,
        max_transitions: Any = None,
        completion: str | None = None,
        parameters: Mapping[str, Any] | None = None,
        initial: Mapping[str, Any] | None = None,
        settings: Mapping[str, Any] | None = None,
        engine: str = "auto",
        precision: int | None = None,
        outputs: Sequence[str] | None = None,
        watch: Callable[[Progress], None] | None = None,
    ) -> Execution:
        """Run the model from t = 0.

        You may give a number as an expression of the model's parameters, such as ``"40*pi"``.

        Parameters
        ----------
        until : number or str, optional
            End of the run.
        scheme : str, optional
            ``located``, ``relaxed`` or ``paoli-schatzman``.
        method : str or ButcherTableau, optional
            A name of `integrators.METHODS`, or ``auto``; a table is then a method under its name.
        step, tolerance : number or str, optional
            Fixed step, or bound on the local error relative to the largest size each state has had; they exclude each
            other.
        relaxation : number or str, optional
            The paper's epsilon: a depth in the model's own units, and a time.
        scale : mapping, optional
            Typical sizes of states by name: the scale of a state is this size until the state becomes larger.
        samples : int, str or sequence, optional
            The number of equally spaced samples, their times, or ``every=TIME`` for its multiples; files have rows at
            these times.
        max_transitions : int or str, optional
            The largest number of transitions; the run stops before it makes another one.
        completion : {"contact", "auto", "none"}, optional
            The motion that follows accumulating transitions.
        parameters, initial : mapping, optional
            Overrides by name; ``initial`` may name ``mode``. Derived parameters are computed again.
        settings : mapping, optional
            Settings, as in ``--set experiment.NAME``. They override those of the file; the arguments above override
            them.
        engine : {"auto", "c", "python"}
            The implementation: compiled code, or the readable loop; ``auto`` is ``c`` if there is a compiler.
        precision : int, optional
            Decimal digits (mpmath numbers) instead of float64.
        outputs : sequence of str, optional
            States and outputs of the result; states on which none of them depends are not integrated (see
            :meth:`only`).
        watch : callable, optional
            Called with the recorder before the run starts.

        Raises UsageError: a name, value or combination is not valid.
        """
        call = locals()  # the arguments, declared once
        del call["self"], call["outputs"], call["watch"]
        if outputs is not None:
            return self._reduced_run(outputs, call, watch)
        given = {
            name: value for name, value in call.items() if value is not None and (name, value) != ("engine", "auto")
        }
        key = call_key(*given, *given.values())
        ready = self.kept_runs.find(key)
        with in_notebook() as show:
            watch = watch or (show and partial(running, show))
            if ready is not None:
                run = ready.simulate(watch, self.pipeline.seconds)
            else:
                ready, run = self._linked(call).settled(watch, self.pipeline.seconds)
                self.kept_runs.keep(key, ready)
        return visible_run(run, ready)

    def _linked(self, call: Mapping[str, Any]) -> Prepared:
        """Prepare runs that know their derivatives and look; mappings are copied, since callers may change them."""
        call = {name: dict(cast("Any", a)) if isinstance(a, Mapping) else a for name, a in call.items()}
        look = partial(self.look, call["parameters"])
        return replace(
            self.pipeline.prepare(call), links={"differentiation": partial(self._differentiate, call), "look": look}
        )

    def _differentiate(self, call: dict[str, Any], wrt: str | Sequence[str]) -> Sensitivity:
        return self._sliding_for(call)._differentiator.of_run(call, wrt)

    def _sliding_for(self, arguments: Mapping[str, Any]) -> Self:
        """Return the model of a run with these arguments: with modes of sliding if its completion is `auto`."""
        return self.sliding if self.pipeline.slides(arguments) else self

    def _reduced_run(
        self, outputs: Sequence[str], arguments: dict[str, Any], watch: Callable[[Progress], None] | None
    ) -> Execution:
        """Run the model reduced to some outputs; initial values and scales of removed states are ignored."""
        smaller = self.only(outputs)
        gone = set(self.columns) - {"mode", *smaller.columns}
        for group in ("initial", "scale"):
            arguments[group] = {
                name: value for name, value in overrides_of(arguments, group, self.program).items() if name not in gone
            }
        return smaller.simulate(**arguments, watch=watch)

    def sensitivity(self, wrt: str | Sequence[str], **arguments: Any) -> Sensitivity:
        """Differentiate a run's end, transition times, states and outputs, through its jumps.

        The derivatives are those of the located execution. They follow from its variational equations and saltation
        matrices.

        Parameters
        ----------
        wrt : str or sequence of str
            Parameters by name and initial states as ``initial.NAME``; a text may have several, with commas.
        **arguments
            Arguments of :meth:`simulate`, except ``step`` and ``outputs``. The scheme is ``located``.

        Raises UsageError: an unknown name, or an argument that is not valid.
        """
        return self._sliding_for(arguments)._differentiator.sensitivity(wrt, arguments)

    @cached_property
    def sliding(self) -> Self:
        """The model with a sliding mode for each surface towards which two flows point; this model if there is none."""
        return self if self.pipeline.sliding is self.pipeline else type(self)(self.pipeline.sliding)

    def only(self, outputs: Sequence[str]) -> Self:
        """Return the model reduced to these states and outputs, and to all that they or any transition depend on.

        It runs as a model without the other states: adaptive steps depend on the remaining states alone, and a state
        that is left out can neither stop a run nor prevent a rest.
        """
        names = tuple(sorted(set(outputs)))
        for name in names:
            if name not in self.columns:
                raise UsageError(f"the model has no state or output '{name}'", did_you_mean(name, self.columns))
        if names not in self._smaller:
            smaller = self.pipeline.only(names)
            self._smaller[names] = self if smaller is self.pipeline else type(self)(smaller)
        return self._smaller[names]

    def look(self, parameters: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Return what a picture shows of the model: its units, levels of its guards, and the program of its mode
        graph.
        """
        from hsdsl.interface.model.guards import guard_lines

        values = self.pipeline.values(parameters=parameters or {})
        return {"guards": guard_lines(values), "units": self.program.units, "program": self.program}
