"""Check a file of SBML by libSBML's rules, simulate it with libRoadRunner, and print the values at some times."""

import json
import sys

import libsbml
import roadrunner

path, times = sys.argv[1], json.loads(sys.argv[2])
document = libsbml.readSBMLFromFile(path)
document.setConsistencyChecks(libsbml.LIBSBML_CAT_UNITS_CONSISTENCY, False)
document.checkConsistency()
found = [document.getError(k) for k in range(document.getNumErrors())]
model = roadrunner.RoadRunner(path)
model.integrator.relative_tolerance, model.integrator.absolute_tolerance = 1e-11, 1e-12
names = list(model.model.getGlobalParameterIds())
model.timeCourseSelections = ["time", *names]
values = model.simulate(times=times)
columns = {name: list(map(float, column)) for name, column in zip(names, values[:, 1:].T, strict=True)}
print(json.dumps({"found": [each.getMessage() for each in found], "columns": columns}))
