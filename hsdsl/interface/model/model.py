"""``Model``: a checked model with its operations; `hsdsl.engine.preparation.pipeline` has its stages."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hsdsl.base.errors import UsageError
from hsdsl.base.limits import Limits
from hsdsl.base.names import NO_FILE, called, checks_arguments, checks_methods, visible
from hsdsl.base.parts import written_modes
from hsdsl.base.progress import counted, counted_runs, in_notebook
from hsdsl.engine.execution import Ensemble, Execution
from hsdsl.engine.preparation.options import arguments_of
from hsdsl.engine.preparation.pipeline import pipeline_of
from hsdsl.engine.preparation.visible import with_output_function
from hsdsl.interface.model.runs import Runs, elsewhere

if TYPE_CHECKING:
    from hsdsl.analysis.fitting.fit import Fit
    from hsdsl.analysis.metrics.interval import Interval
    from hsdsl.analysis.metrics.points import PointDistance, SpacePoint
    from hsdsl.analysis.orbits.continuation import Branch
    from hsdsl.analysis.orbits.orbit import Orbit
    from hsdsl.analysis.orbits.sampling import OrbitalStability
    from hsdsl.analysis.sweep import Sweep
    from hsdsl.analysis.sweep.manifest import Manifest
    from hsdsl.engine.simulate.recorder import Progress
    from hsdsl.interface.model.estimate import Estimate
    from hsdsl.interface.model.stream import Streamed


@checks_arguments
def load(path: str | os.PathLike[str], limits: Limits | None = None, *, text: bytes | None = None) -> Model:
    """Read a model file; `-` is standard input.

    ``text`` is the file's content if it does not come from ``path``; ``limits`` replace the default caps on the file
    and the folders of its data.

    Raises ModelError: the model has errors; the exception has all of them.
    Raises UsageError: the file cannot be read.
    """
    return Model(pipeline_of(path, limits, text))


@checks_arguments
def loads(text: str, folder: str | os.PathLike[str] | None = None, limits: Limits | None = None) -> Model:
    """Read a model from its text; data files are in ``folder``, by default the current one.

    ``limits`` are as for :func:`load`.

    Raises ModelError: the model has errors; the exception has all of them.
    """
    return Model(pipeline_of(Path(folder or "") / NO_FILE, limits, text.encode("utf-8", errors="surrogatepass")))


@partial(checks_methods, elsewhere=elsewhere)
class Model(Runs):
    """A checked model: ``system`` is the mathematics, ``program`` its routines for an engine, ``pipeline`` both.

    It does not change if its file changes later, and it can be pickled.
    """

    def __repr__(self) -> str:
        name = visible(called(None, Path(self.program.path).name).removeprefix("a model "))
        if parts := self.program.parts:
            return f"<hsdsl model {name}: a system of {len(parts)} parts>"
        names = [mode.name for mode in written_modes(self.program.modes)]
        modes = ", ".join([*names[:8], *["..."] * (len(names) > 8)])
        return f"<hsdsl model {name}: modes {modes}>"

    def _repr_html_(self) -> str:
        """Show modes, equations and the graph of modes in notebooks."""
        from hsdsl.analysis.report.model import model_html

        return model_html(self.system, self.program)

    def _flat(self, what: str) -> None:
        """Refuse operations that systems of parts do not support yet."""
        if self.program.parts:
            raise UsageError(f"{what} cannot be had of a system of parts", "write the modes of a small one out")

    def orbit(
        self,
        section: str,
        *,
        laps: int = 1,
        period: Any = None,
        keep: str | None = None,
        progress: Callable[[int, float | None], None] | None = None,
        **arguments: Any,
    ) -> Orbit:
        """Find a periodic orbit by shooting on a section, with its Floquet multipliers.

        The initial guess is the passage of the section in the model's own run to which the run returns most closely.

        Parameters
        ----------
        section : str
            The name of a transition.
        laps : int
            Number of transitions of the section after which the orbit closes.
        period : number or str, optional
            The period of the forcing; by default that of the sines and cosines of time in the model.
        keep : str, optional
            A quantity that flows and resets keep, such as an energy: an expression of states and parameters, or an
            output. The orbit has the run's value of this quantity, and its stability is that within this level set.
        progress : callable, optional
            Called before every run with its number, and the value of the continuation parameter, if any.
        **arguments
            Arguments of :meth:`simulate`, except ``step``, ``scheme``, ``samples`` and ``precision``.

        Raises UsageError: no such transition, an unknown argument, or no orbit near the run.
        """
        from hsdsl.interface.model.orbits import Orbits

        with in_notebook() as show:
            progress = progress or counted_runs(show)
            return Orbits(self._sliding_for(arguments), section, laps, period, progress, arguments, keep).find()

    def continuation(
        self,
        section: str,
        parameter: str,
        start: Any,
        end: Any,
        *,
        laps: int = 1,
        period: Any = None,
        keep: str | None = None,
        progress: Callable[[int, float | None], None] | None = None,
        **arguments: Any,
    ) -> Branch:
        """Follow a periodic orbit in a parameter, around folds, and locate its bifurcations.

        The branch begins at the parameter's own value if that is in the range, or else at ``start``, and goes in both
        directions.

        Parameters
        ----------
        section, laps, period, keep, progress, **arguments
            As for :meth:`orbit`; all orbits have the same value of what they ``keep``.
        parameter : str
        start, end : number or str
            The range of the parameter.

        Raises UsageError: as :meth:`orbit`; or no such parameter.
        """
        from hsdsl.interface.model.orbits import Orbits

        with in_notebook() as show:
            progress = progress or counted_runs(show, parameter)
            orbits = Orbits(self._sliding_for(arguments), section, laps, period, progress, arguments, keep)
            return orbits.continued(parameter, start, end)

    def orbital_stability(
        self,
        wrt: str | Sequence[str] | None = None,
        *,
        radii: Sequence[float] = (1e-3, 1e-5, 1e-7),
        samples: int = 8,
        seed: int = 0,
        progress: Callable[[int, int], None] | None = None,
        **arguments: Any,
    ) -> OrbitalStability:
        """Test by nearby runs whether the model's execution is orbitally stable, in the quotient metric.

        Parameters
        ----------
        wrt : str or sequence of str, optional
            Names to vary: initial states as ``initial.NAME``, and parameters, such as those of inputs; by default all
            initial states.
        radii : sequence of float
            Decreasing distances, relative to each value (or, if that is zero, to the state's largest size).
        samples : int
            Number of directions at each radius; at least both directions of every axis.
        seed : int
            Seed of the random directions.
        progress : callable, optional
            Called after each run with the number of finished runs and their total number.
        **arguments
            Arguments of :meth:`simulate`, except ``step``, ``scheme``, ``samples`` and ``precision``.

        Raises UsageError: an unknown name, or radii that do not decrease.
        """
        from hsdsl.interface.model.distances import orbital_stability

        self._flat("orbital stability from runs nearby")
        with in_notebook() as show:
            progress = progress or counted(show, "runs")
            return orbital_stability(self._sliding_for(arguments), wrt, radii, samples, seed, progress, arguments)

    def fit(
        self,
        data: Any,
        wrt: str | Sequence[str],
        *,
        sigma: Mapping[str, float] | float | None = None,
        weights: Mapping[str, float] | float | None = None,
        intervals: float | None = None,
        starts: int = 1,
        progress: Callable[[int, Mapping[str, float], float], None] | None = None,
        **arguments: Any,
    ) -> Fit:
        """Fit parameters and initial states to measurements, by least squares with exact derivatives.

        Parameters
        ----------
        data : path, mapping or DataFrame
            A CSV file, or columns by name: ``t`` or ``time``, states, outputs. An empty or NaN cell was not measured.
        wrt : str or sequence of str
            Names to fit: parameters, within the bounds of the file, and initial states as ``initial.NAME``. The initial
            guess is that of the file, or of ``parameters`` and ``initial``.
        sigma : mapping or number, optional
            The standard deviation of each column, or of a single column.
        weights : mapping or number, optional
            The weight of each column, in place of ``sigma``; by default one over the column's largest size.
        intervals : float, optional
            The level, such as 0.95, of intervals by profile likelihood: many further runs.
        starts : int, optional
            The number of initial guesses: the given one, and others drawn within the bounds of the file, or by a factor
            of up to 4 without bounds. The best fit is kept.
        progress : callable, optional
            Called after every run with the number of runs, the values, and the weighted sum of squares.
        **arguments
            Arguments of :meth:`simulate`, except ``step``, ``scheme``, ``samples``, ``precision`` and ``until``.

        Raises UsageError: an unknown name or column, or a run that does not reach the measurements.
        """
        from hsdsl.interface.model.fits import fit

        with in_notebook() as show:
            progress = progress or (show and (lambda runs, _, squares: show(lambda: f"{runs} runs, {squares:.6g}")))
            return fit(self._sliding_for(arguments), data, wrt, sigma, weights, intervals, starts, progress, arguments)

    def stream(
        self,
        path: str | os.PathLike[str],
        *,
        every: int = 1,
        columns: Sequence[str] | None = None,
        watch: Callable[[Progress], None] | None = None,
        **arguments: Any,
    ) -> Streamed:
        """Run the model and write its rows to a CSV file during the run, in constant memory.

        The file has the first row, every k-th, both rows of each jump and the last. It has complete lines at any time,
        so the file of a killed run is readable. An existing file of this name is overwritten.

        Parameters
        ----------
        path : path
            A name ending in .csv.
        every : int
            The k above.
        columns : names, optional
            States and outputs in the file; by default all.
        watch : callable, optional
            As for :meth:`simulate`.
        **arguments
            Further arguments of :meth:`simulate`, except ``precision`` and ``samples``.

        Raises UsageError: there is no compiled engine, the file cannot be written, or the disk is full.
        """
        from hsdsl.interface.model.stream import check, stream

        self._flat("rows in a file while a run goes on")
        target = check(path, every, columns, arguments, self)
        prepared = self.pipeline.prepare(arguments | {"engine": "c"})
        return stream(prepared, target, every, columns, watch)

    def ensemble(
        self,
        *,
        parameters: Mapping[str, Any] | None = None,
        initial: Mapping[str, Any] | None = None,
        samples: Any = None,
        transition_times: int = 0,
        every_transition: bool = False,
        threads: int | None = None,
        progress: Callable[[int, int], None] | None = None,
        **arguments: Any,
    ) -> Ensemble:
        """Run many instances of the model, on all cores if there is a compiler.

        Every instance equals the run of :meth:`simulate`, to the last bit. Ctrl-C keeps the finished instances.

        Parameters
        ----------
        parameters, initial : mapping, optional
            Overrides by name: numbers, expressions, or arrays of numbers. Arrays are broadcast to a common shape, as in
            NumPy; each element is an instance.
        samples : int, sequence of float or str, optional
            Sample times of every run: their number, equally spaced from 0 to its ``until``, the times, or an expression
            of parameters, such as ``"2*pi/w"``, for its multiples.
        transition_times : int
            Number of first transitions of each run whose times are kept.
        every_transition : bool
            Whether to keep every transition, with the states before and after it: `Ensemble.transition_table`.
        threads : int, optional
            The number of threads; by default the number of cores for this process.
        progress : callable, optional
            Called from time to time with the number of finished instances and their total number.
        **arguments
            Further arguments of :meth:`simulate` for every instance, except ``precision`` and ``outputs``.

        Raises UsageError: an unknown name, arrays of different shapes, or no instance that can be run.
        """
        from hsdsl.interface.model.ensemble import run_ensemble

        call = arguments | {"parameters": parameters or {}, "initial": initial or {}}
        with in_notebook() as show:
            progress = progress or counted(show, "runs")
            return run_ensemble(self, call, samples, transition_times, threads, progress, every_transition)

    def sweep(
        self,
        vary: Sequence[str] | Mapping[str, Any],
        out: str | os.PathLike[str],
        *,
        random: int | None = None,
        seed: int = 0,
        record: str | Sequence[str] = "final",
        outputs: Sequence[str] | None = None,
        cluster: str | None = None,
        processes: int | None = None,
        chunk: int | None = None,
        progress: Callable[[int, int], None] | None = None,
        check: Callable[[Manifest], None] | None = None,
        **arguments: Any,
    ) -> Sweep:
        """Run the model over many values into a dataset of Parquet files, on all cores or on a Dask cluster.

        The same call resumes a dataset that is not complete. A run that fails is a row with its reason.

        Parameters
        ----------
        vary : sequence of str or mapping
            Texts such as ``"c=0.5:0.95:101"`` and ``"c~normal(0.9, 0.02)"`` (`sweep.variation`), or a mapping from each
            name to the text after it or to an array of values. Names are parameters, and initial states as
            ``initial.NAME``. If a state has a range under `initial` and is neither named here nor given, the sweep
            draws it from this range.
        out : path
            The folder of the dataset: a new one, or that of the same sweep.
        random : int, optional
            Rows for each point of the grid, if values are drawn.
        seed : int
            Seed of the draws. A row has the same values for any number of workers.
        record : str or sequence of str
            Records of each run besides its end (`hsdsl.analysis.sweep.manifest`).
        outputs : sequence of str, optional
            States and outputs, as for :meth:`simulate`; the others have no columns.
        cluster : str, optional
            The address of a Dask scheduler, such as ``tcp://host:8786``.
        processes : int, optional
            Number of processes on this machine; by default the number of cores of this process.
        chunk : int, optional
            Rows of each file; by default it follows from a few timed runs.
        progress : callable, optional
            Called after each chunk with the number of finished rows and their total number.
        check : callable, optional
            Called with the plan before the first run; it may raise UsageError.
        **arguments
            Further arguments of :meth:`simulate` for every run, except ``precision``, ``samples`` and ``watch``.

        Raises UsageError: an unknown name, a folder of another sweep, or a cluster that does not answer.
        """
        from hsdsl.interface.model.sweeps import sweep

        with in_notebook() as show:
            progress = progress or counted(show, "rows")
            asked = {"vary": vary, "random": random, "seed": seed, "record": record, "outputs": outputs}
            return sweep(self, Path(out), cluster, processes, chunk, progress, check, **asked, arguments=arguments)

    def completed(self) -> str | None:
        """Return the text of the model with modes for motion along guards and for sliding; None if there are none.

        It is an ordinary model, for every engine and export. A transition enters the motion along its guard if the next
        flight would last less than the parameter ``contact_time``.
        """
        self._flat("a completed text")
        from hsdsl.language.elaborate import elaborate_files
        from hsdsl.mathematics.completion.text import completed_text

        files = self.pipeline.files
        if files is None:
            raise UsageError("expected a model that was read from text")
        read = elaborate_files(files)
        if read.system.unknowns:
            message = "a model with `solve` cannot be written with its completions"
            raise UsageError(message, "write its solutions under `let`")
        text = completed_text(read.text, read.root, read.system)
        declared = {name for mode in read.document.modes.values() for name in mode.flow or ()}
        if text is not None and not declared >= {*read.system.states}:
            hint = "write it as a state: its flow 1 in each mode, and since: 0 in each reset"
            raise UsageError("a model that uses `since` or events cannot be written with its completions", hint)
        return text

    def estimate(self, execution: Execution) -> Estimate:
        """Compare an execution of this model with a finer run (see `hsdsl.interface.model.estimate`)."""
        from hsdsl.interface.model.estimate import estimate

        return estimate(execution)

    def plot(
        self,
        runs: Execution | Sequence[Execution],
        path: str | os.PathLike[str],
        parameters: Mapping[str, Any] | None = None,
        **options: Any,
    ) -> None:
        """Draw executions of this model to a .png, .svg or .html file, with the levels of its guards.

        Parameters
        ----------
        runs : Execution or sequence of Execution
            One execution, or several for one picture.
        parameters : mapping, optional
            The overrides of the run, on which the levels depend.
        **options
            ``columns``, ``phases``, ``labels`` and ``title`` of `hsdsl.analysis.plot.View`.

        Raises UsageError: an unknown name or suffix, or a file that cannot be written.
        """
        from hsdsl.analysis.plot import plot

        plot(runs, path, **self.look(parameters), **options)

    def animate(
        self,
        path: str | os.PathLike[str],
        *,
        speed: float | None = None,
        progress: Callable[[int, int], None] | None = None,
        **arguments: Any,
    ) -> Execution:
        """Run the model and write its scene as a film: .gif, or .mp4 if ffmpeg is installed.

        Parameters
        ----------
        speed : float, optional
            Model time per second of the film; by default 1 if the film then lasts 4 to 20 s, or else a value for such a
            length.
        progress : callable, optional
            Called after each frame with the number of finished frames and their total number.
        **arguments
            Arguments of :meth:`simulate`, except ``outputs``.

        Returns
        -------
        Execution
            The run, with the numbers of the scene as further outputs.

        Raises UsageError: the model has no scene, or the file cannot be written.
        """
        from hsdsl.analysis.plot.animation import animate, check

        check(path)
        run = self._staged.simulate(**arguments)
        with in_notebook() as show:
            unit = self.program.units.get("t")
            animate(run, self.system.scene, path, speed, unit, progress or counted(show, "frames"))
        return run

    def check_scene(self) -> None:
        """Raise UsageError if the model has no scene."""
        if not self.system.scene:
            raise UsageError("the model has no scene to animate", "a scene has shapes: scene: [{point: [x, 0]}]")

    @cached_property
    def _staged(self) -> Model:
        """Return the model with the numbers of its scene as further outputs."""
        from hsdsl.language.elaborate.modes import scene_as_outputs

        self.check_scene()
        return Model(scene_as_outputs(self.system))

    def with_outputs(self, run: Execution) -> Execution:
        """Return a run that was read from a file, with outputs between rows computed by this model.

        A file has the outputs only at rows.

        Raises UsageError: the run is not one of this model in its present form.
        """
        if run.digest != self.program.digest:
            hint = "run it again, or give the model as it was"
            raise UsageError(f"{self.program.path} is not the model that the run is of, or was edited since", hint)
        if "left_out" in run.settings or run.output_names != self.program.outputs:
            return run
        arguments = arguments_of(run.overrides) | {"precision": run.digits, "engine": "python"}
        return with_output_function(run, self.pipeline.prepare(arguments))

    def distance(
        self,
        p: str | SpacePoint,
        q: str | SpacePoint,
        *,
        metric: str = "quotient",
        relaxation: Any = None,
        parameters: Mapping[str, Any] | None = None,
        hops: int | None = None,
        seconds: float = 60.0,
        plot: str | os.PathLike[str] | None = None,
    ) -> PointDistance:
        """Return the distance of two points: the length of the shortest curve, which may pass through guards.

        Parameters
        ----------
        p, q : str or SpacePoint
            A mode and all its states, as ``"free x=13 v=5"``; values are expressions of parameters.
        metric : {"quotient", "relaxed"}
            The paper's d_M (Def. 12), or the metric of the relaxed space (Def. 19).
        relaxation : number or str, optional
            The paper's epsilon; by default that of a run of the file.
        parameters : mapping, optional
            Overrides by name.
        hops : int, optional
            The largest number of passages of a path; by default eight more than the fewest that connect the modes. The
            lower end also holds for paths with more.
        seconds : float
            Time limit of the search. If it is reached, the interval is wider, and ``certified`` says so.
        plot : path, optional
            File for a picture of the shortest path found (.png or .svg), if its modes have two coordinates.

        Raises UsageError: a point or a number does not fit the model, or a point is outside its mode's domain.
        """
        from hsdsl.interface.model.distances import budget_of, distance_of_points

        self._flat("a distance of two points")

        values = self.pipeline.values(parameters=parameters or {})
        return distance_of_points(values, p, q, metric, relaxation, hops, budget_of(seconds), plot)


def distance(first: Any, second: Any, third: Any = None, **arguments: Any) -> Interval:
    """Return the distance of two runs, or of two points of a model.

    Parameters
    ----------
    first : Execution, Model or path
        The first of two runs of a model; or a model, for the distance of two of its points.
    second : Execution, str or SpacePoint
        The second run; or a point, as ``"free x=13 v=5"``.
    third : str or SpacePoint, optional
        The second point.
    **arguments
        Further arguments of :func:`distance_of_runs`, or of :meth:`hsdsl.Model.distance`.

    The interval contains the distance; :meth:`hsdsl.Model.distance` also returns the path, and :func:`distance_of_runs`
    the time.

    Raises UsageError: the arguments are neither, or do not fit the model.
    """
    from hsdsl.analysis.metrics.points import SpacePoint
    from hsdsl.interface.model.distances import distance_of_runs

    if isinstance(first, Execution) and isinstance(second, Execution) and third is None:
        return distance_of_runs(first, second, **arguments).interval
    model = load(first) if isinstance(first, (str, os.PathLike)) else first  # pyright: ignore[reportUnknownArgumentType]
    if isinstance(model, Model) and isinstance(second, (str, SpacePoint)) and isinstance(third, (str, SpacePoint)):
        return model.distance(second, third, **arguments).interval
    raise UsageError(
        "distance takes two runs, or a model and two of its points",
        'for example distance(run, other) or distance(model, "free x=13 v=5", "free x=13 v=-4")',
    )
