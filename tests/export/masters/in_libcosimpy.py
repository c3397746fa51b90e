# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false
"""libcosimpy: a ball, and a mass driven by another unit, until 6."""

import json
import sys

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

folder, step = sys.argv[1], float(sys.argv[2])
execution, observer = CosimExecution.from_step_size(round(step * 1e9)), CosimObserver.create_last_value()
units = {
    name: execution.add_local_slave(CosimLocalSlave(fmu_path=f"{folder}/{name}.fmu", instance_name=name))
    for name in ("ball", "driver", "mass")
}
places = {name: {v.name.decode(): v.reference for v in execution.slave_variables(k)} for name, k in units.items()}
execution.connect_real_variables(units["driver"], places["driver"]["force"], units["mass"], places["mass"]["u"])
execution.add_observer(observer)
execution.simulate_until(6 * 10**9)
found = {
    name: observer.last_real_values(units[name], [places[name][state] for state in states])
    for name, states in (("ball", "hvn"), ("mass", "xvn"))
}
print(json.dumps(found))
