#!/usr/bin/env bash
# Installs what tests marked `tools` run and PyPI does not have, on Debian or Ubuntu, as root. Then: pytest -m tools
# What PyPI has is in the extra `export`: pip install 'hsdsl[export]'
set -euo pipefail
packages=(
  chromium chromium-driver fonts-dejavu-core          # pages of --to web
  octave                                              # --to matlab
  cargo rustc                                         # --to rust
  texlive-latex-base texlive-latex-recommended        # --to latex
  clang cmake                                         # --to c with a second compiler, and its own build files
)
apt-get update
apt-get install --yes --no-install-recommends "${packages[@]}"
