# pyright: basic, reportMissingImports=false
"""Jaxonomy: a ball, and a mass driven by another unit, until 6, by co-simulation; ``exchange`` for model exchange."""

import json
import sys

import jaxonomy
from jaxonomy.library.fmu_import import ModelicaFMU, ModelicaFMUME

folder, step, *exchange = sys.argv[1], float(sys.argv[2]), *sys.argv[3:]
diagram = jaxonomy.DiagramBuilder()
blocks = {}
for name in ("ball", "driver", "mass"):
    path = f"{folder}/{name}.fmu"
    made = (
        ModelicaFMUME(path, name=name) if exchange else ModelicaFMU(path, dt=step, name=name, first_step_at_zero=True)
    )
    blocks[name] = diagram.add(made)
force = next(port for port in blocks["driver"].output_ports if port.name == "force")
diagram.connect(force, blocks["mass"].input_ports[0])
whole = diagram.build()
recorded = {f"{name} {port.name}": port for name in ("ball", "mass") for port in blocks[name].output_ports}
options = jaxonomy.SimulatorOptions(rtol=1e-9, atol=1e-10, max_major_steps=5000)
run = jaxonomy.simulate(whole, whole.create_context(), (0.0, 6.0), options=options, recorded_signals=recorded)
end = {name: float(values[-1]) for name, values in run.outputs.items()}
states = {"ball": "hvn", "mass": "xvn"}
print(json.dumps({name: [end[f"{name} {state}"] for state in states[name]] for name in states}))
