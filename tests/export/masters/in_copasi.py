"""Simulate a file of SBML with COPASI, and print the values at some times."""

import json
import sys

import basico

path, times = sys.argv[1], json.loads(sys.argv[2])
basico.load_model(path)
table = basico.run_time_course(values=times, r_tol=1e-11, a_tol=1e-12, max_steps=1_000_000, use_sbml_id=True)
found = [] if len(table) == len(times) else [f"ended at {table.index[-1]}"]
columns = {name.removeprefix("Values[").removesuffix("]"): list(map(float, table[name])) for name in table.columns}
print(json.dumps({"found": found, "columns": columns}))
