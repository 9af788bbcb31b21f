#!/usr/bin/env bash
# Sets up what the tests need and runs all of them: format, lints, documentation, unit tests, physics, the
# program under mpirun, and the output in h5py and VTK. The long ones are in launch/test-long.sh.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

launch/setup.sh --packages
. launch/env.sh

# Readers of the output, in a folder of their own.
if ! .venv/bin/python -c 'import h5py, vtkmodules.vtkIOHDF' 2>/dev/null; then
    rm -rf .venv
    python3 -m venv .venv
    .venv/bin/pip install -q --disable-pip-version-check h5py vtk numpy
fi
export DEMHYBRID_PYTHON="$PWD/.venv/bin/python"

make check
echo
echo "test.sh: format, lints, documentation and all tests passed"
