# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false
"""CasADi's DaeBuilder: a ball until 6, of which CasADi's integrator takes the flow alone."""

import json
import sys
import zipfile

import casadi

folder = sys.argv[1]
zipfile.ZipFile(f"{folder}/ball.fmu").extractall(f"{folder}/ball")
flow = casadi.DaeBuilder("ball", f"{folder}/ball").create("flow", ["t", "x"], ["ode"])
t, x = casadi.MX.sym("t"), casadi.MX.sym("x", 3)
tight = {"abstol": 1e-10, "reltol": 1e-10}
run = casadi.integrator("run", "cvodes", {"t": t, "x": x, "ode": flow(t, x)}, 0.0, 6.0, tight)
print(json.dumps({"ball": run(x0=[10, 0, 0])["xf"].full().ravel().tolist()}))
