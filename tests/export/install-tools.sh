#!/usr/bin/env bash
# Installs what tests marked `tools` run and PyPI does not have, on Debian or Ubuntu, as root. Then: pytest -m tools
# What PyPI has is in the extra `export`: pip install 'hsdsl[export]'
set -euo pipefail
packages=(
  chromium chromium-driver fonts-dejavu-core          # pages of --to web
  octave octave-dev                                   # --to matlab, and MEX files
  cargo rustc                                         # --to rust
  texlive-latex-base texlive-latex-recommended        # --to latex
  clang cmake                                         # --to c with a second compiler, and its own build files
)
apt-get update
apt-get install --yes --no-install-recommends "${packages[@]}"

# The Modelica Association's own ball, beside which tests of --to fmi2 and --to fmi3 simulate ours.
reference=${HSDSL_REFERENCE_FMUS:-/opt/reference-fmus}
if [ ! -d "$reference" ]; then
  apt-get install --yes --no-install-recommends git gcc libc6-dev make
  sources=$(mktemp -d)
  git clone --quiet --depth 1 https://github.com/modelica/Reference-FMUs "$sources"
  for version in 2 3; do
    cmake -S "$sources" -B "$sources/build$version" -DFMI_VERSION=$version
    cmake --build "$sources/build$version" --target BouncingBall
    install -D "$sources/build$version/fmus/BouncingBall.fmu" "$reference/BouncingBall$version.fmu"
  done
  rm -rf "$sources"
fi

# Importers of functional mock-up units, each in an environment of its own: test_masters.py. ecospy needs TBB.
importers=${HSDSL_IMPORTERS:-/opt/fmi-importers}
for package in libcosimpy==0.0.6 ecospy==0.7.2 cofmupy==1.0.0 pathsim-fmi==0.1.1 casadi==3.8.2 \
  fmu-manipulation-toolbox==2.0 copasi-basico==0.92 jaxonomy==3.4.1; do
  environment=$importers/${package%%=*}
  [ -d "$environment" ] || python3 -m venv "$environment"
  "$environment/bin/pip" install --quiet "$package"
done
"$importers/ecospy/bin/pip" install --quiet tbb

# What runs --to sbml: test_sbml_export.py.
[ -d "$importers/libroadrunner" ] || python3 -m venv "$importers/libroadrunner"
"$importers/libroadrunner/bin/pip" install --quiet libroadrunner==2.10.0 python-libsbml==5.21.2
"$importers/copasi-basico/bin/pip" install --quiet python-copasi==4.48.311
"$importers/pathsim-fmi/bin/pip" install --quiet pathsim==0.27.1
