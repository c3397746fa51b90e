"""Sweeps: runs of one model over many values, as a dataset of Parquet files.

=============  ============================================================================================
`variation`    what varies: grids and random draws
`manifest`     what a dataset is of: model, values, settings, what is recorded; its columns, and their rows
`dataset`      a folder with a manifest and a file for each chunk of rows: made, read, summed up
`picture`      what is drawn of it
`cluster`      chunks to the workers of Dask
=============  ============================================================================================

The runs themselves are made in `hsdsl.interface.model.sweeps`.
"""

from hsdsl.analysis.sweep.dataset import Sweep, load
from hsdsl.analysis.sweep.manifest import Recording
from hsdsl.analysis.sweep.variation import Variation

__all__ = ["Recording", "Sweep", "Variation", "load"]
