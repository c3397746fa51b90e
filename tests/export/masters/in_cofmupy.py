# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false
"""cofmupy: a ball, and a mass driven by another unit, until 6."""

import json
import sys
from pathlib import Path

from cofmupy.coordinator import Coordinator

folder, step = sys.argv[1], float(sys.argv[2])
connection = {"source": {"id": "driver", "variable": "force"}, "target": {"id": "mass", "variable": "u"}}
units = [{"id": name, "path": f"{folder}/{name}.fmu"} for name in ("ball", "driver", "mass")]
(place := Path(folder, "cofmupy.json")).write_text(json.dumps({"fmus": units, "connections": [connection]}))
coordinator = Coordinator()
coordinator.start(str(place))
for _ in range(round(6 / step)):
    coordinator.do_step(step, save_data=True)
found = {
    name: [float(coordinator.get_variable((name, state))[-1]) for state in states]
    for name, states in (("ball", "hvn"), ("mass", "xvn"))
}
print(json.dumps(found))
