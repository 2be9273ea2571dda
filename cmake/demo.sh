#!/usr/bin/env bash
# Installs what is missing, builds the command and runs its demo. Pictures and numbers end up in demo-output/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source cmake/packages.sh
install_packages

cmake --preset release
cmake --build --preset release
build/release/bin/dpr demo -o demo-output
echo "The pictures are in $PWD/demo-output:"
ls -1 demo-output
