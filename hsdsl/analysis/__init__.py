"""Questions about executions, and their answers as text, files and pictures.

In: executions, systems and programs. Out: distances (`metrics`), exact runs (`exact`), derivatives (`sensitivity`),
periodic orbits (`orbits`), parameters (`fitting`), datasets of many runs (`sweep`), findings in models (`lint`).

`report`, `store` and `plot` show all of these: results have `summary`, `save` and `plot` of their own.
"""
