# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false
"""PathSim with pathsim-fmi: a ball, and a mass driven by another unit, until 6; ``exchange`` for model exchange."""

import json
import sys

from pathsim import Connection, Simulation
from pathsim.solvers import RKDP54
from pathsim_fmi import CoSimulationFMU, ModelExchangeFMU

folder, step, *exchange = sys.argv[1], float(sys.argv[2]), *sys.argv[3:]
blocks = {
    name: ModelExchangeFMU(f"{folder}/{name}.fmu") if exchange else CoSimulationFMU(f"{folder}/{name}.fmu", dt=step)
    for name in ("ball", "driver", "mass")
}
solver = {"Solver": RKDP54, "tolerance_lte_rel": 1e-9, "tolerance_lte_abs": 1e-9, "dt_max": 0.05} if exchange else {}
connections = [Connection(blocks["driver"]["force"], blocks["mass"]["u"])]
simulation = Simulation([*blocks.values()], connections, dt=step, log=False, **solver)
simulation.run(6.0, adaptive=bool(exchange))
print(json.dumps({name: blocks[name].fmu_wrapper.get_outputs_as_array().tolist() for name in ("ball", "mass")}))
