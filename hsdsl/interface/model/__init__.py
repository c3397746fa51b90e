"""A model: from a YAML file to executions, ensembles and analyses.

================= ==========================================================================================
``model``         :func:`load`, :func:`loads`, :class:`Model`: what can be done with a model
``runs``          its runs, and what all that is made of runs needs; ``call_cache`` has runs of the last calls
``ensemble``      many instances
``sweeps``        many instances into a dataset, chunk by chunk
``stream``        a run whose rows go to a file while it goes on
``estimate``      a run's error, by a finer run
``distances``     distances of runs and of points, and orbital stability by runs from nearby
``differentiate`` sensitivities; ``fits`` to measurements
``orbits``        periodic orbits
``guards``        levels for pictures
================= ==========================================================================================
"""

from hsdsl.engine.preparation.options import split_overrides
from hsdsl.interface.model.model import Model, distance, load, loads

__all__ = ["Model", "distance", "load", "loads", "split_overrides"]
