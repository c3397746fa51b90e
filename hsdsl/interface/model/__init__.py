"""A model: from a YAML file to executions, ensembles and analyses.

================= ==========================================================================================
``model``         :func:`load`, :func:`loads`, :class:`Model`: a model with its operations
``call_cache``    runs prepared for the last calls
``ensemble``      many instances, from an ``ensemble_request``; ``workers`` runs them
``sweeps``        many instances into a dataset; ``chunk_work`` makes a part of it
``stream``        a run that writes its rows to a file
``estimate``      a run's error, by a finer run
``distances``     distances of runs; ``points`` those of points
``differentiate`` sensitivities; ``fits`` to measurements
``orbits``        periodic orbits; ``nearby`` orbital stability by nearby runs
``guards``        levels for pictures
================= ==========================================================================================
"""

from hsdsl.engine.preparation.options import split_overrides
from hsdsl.interface.model.model import Model, load, loads

__all__ = ["Model", "load", "loads", "split_overrides"]
