# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false
"""ecospy: a ball, and a mass driven by another unit, until 6."""

import json
import sys

from ecospy import EcosSimulation, EcosSimulationStructure

folder, step = sys.argv[1], float(sys.argv[2])
with EcosSimulationStructure() as structure:
    for name in ("ball", "driver", "mass"):
        structure.add_model(name, f"{folder}/{name}.fmu")
    structure.make_real_connection("driver::force", "mass::u")
    with EcosSimulation(structure=structure, step_size=step) as simulation:
        simulation.init()
        simulation.step(round(6 / step))
        found = {
            name: [simulation.get_real(f"{name}::{state}") for state in states]
            for name, states in (("ball", "hvn"), ("mass", "xvn"))
        }
        print(json.dumps(found))
