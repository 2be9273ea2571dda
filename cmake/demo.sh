#!/usr/bin/env bash
# Installs what is missing, builds the command and runs its demo. Pictures and numbers end up in demo-output/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source cmake/packages.sh
install_packages demo

cmake --preset demo
cmake --build --preset demo
echo "The pictures are in $PWD/demo-output; index.html shows them."
