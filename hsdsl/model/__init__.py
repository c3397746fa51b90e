"""A model: a YAML file turned into something that runs.

============= ===========================================================================================
``model``     :func:`load`, :func:`loads`, :class:`Model`: what can be done with a model
``pipeline``     what it is made of, each part made once: the pipeline in one place
``written``   the bytes that a model is made of, read once
``seen``      programs of models read before, so that to run one again needs no SymPy
``requests``  what a run is asked, from four places: the file, ``--set``, options and a call
``values``    overrides, as numbers or expressions of parameters; ``overrides`` reads them from text
``settings``  the numbers of a run; ``automatic`` chooses its method, ``engines`` what runs it
``instances`` the instances of an ensemble; ``ensemble`` runs them, ``workers`` with Python
``stream``    a run whose rows go to a file while it goes on
``estimate``  a run's error, by a finer run
``distances`` distances of points and of runs; with ``places`` and ``between_runs``
============= ===========================================================================================
"""

from hsdsl.model.model import Model, load, loads
from hsdsl.model.overrides import split_overrides

__all__ = ["Model", "load", "loads", "split_overrides"]
