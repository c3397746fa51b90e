"""A model: a YAML file turned into something that runs.

================= ==========================================================================================
``model``         :func:`load`, :func:`loads`, :class:`Model`: what can be done with a model
``pipeline``      its stages, each made once: mathematics, program, kernels, compiled code
``call_cache``    runs prepared for the last calls
``options``       options of the file, of ``--set`` and of a call
``values``        parameters, constants and initial states, of one run or of many instances
``settings``      the numbers of a run; ``automatic`` chooses its method, ``engines`` its loop
``ensemble``      many instances, from an ``ensemble_request``; ``workers`` runs them
``sweeps``        many instances into a dataset; ``chunk_work`` makes a part of it
``stream``        a run whose rows go to a file while it goes on
``estimate``      a run's error, by a finer run
``distances``     distances of runs; ``points`` those of points
``differentiate`` sensitivities; ``fits`` to measurements
``orbits``        periodic orbits; ``nearby`` orbital stability by runs from nearby
``mechanical``    one mass against one stop, for the scheme paoli-schatzman
``visible``       runs of systems of parts as readers see them; ``guards`` levels for pictures
================= ==========================================================================================
"""

from hsdsl.engine.preparation.options import split_overrides
from hsdsl.interface.model.model import Model, load, loads

__all__ = ["Model", "load", "loads", "split_overrides"]
