#!/usr/bin/env bash
# Sets demhybrid up: installs the system packages that are missing (Debian and its relatives), builds the program and
# installs it with cargo. May be run again at any time.
#   launch/setup.sh              packages and program
#   launch/setup.sh --packages   packages only, with what the tests need
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

die() {
    printf 'setup: %s\n' "$*" >&2
    exit 1
}

# Open MPI, parallel HDF5 for it, and what their bindings are generated with.
packages=(libopenmpi-dev openmpi-bin libhdf5-openmpi-dev libclang-dev clang pkg-config)
if [ "${1:-}" = --packages ]; then
    packages+=(python3 python3-venv)
fi

command -v cargo >/dev/null || die "cargo is missing: install Rust 1.89 or later first, see https://rustup.rs"
command -v cc >/dev/null || die "a C compiler is missing: install gcc first"

if command -v dpkg-query >/dev/null; then
    missing=()
    for package in "${packages[@]}"; do
        dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'install ok installed' || missing+=("$package")
    done
    if [ ${#missing[@]} -gt 0 ]; then
        if [ "$(id -u)" -eq 0 ]; then
            root=()
        elif command -v sudo >/dev/null; then
            root=(sudo)
        else
            die "these packages are missing and only root can install them: apt-get install ${missing[*]}"
        fi
        echo "setup: installing ${missing[*]}"
        "${root[@]}" apt-get update -q
        "${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${missing[@]}"
    fi
else
    command -v mpicc >/dev/null || die "this is not Debian: mpicc must be in PATH (load your site's MPI module)"
    [ -n "${HDF5_DIR:-}" ] || echo "setup: this is not Debian: set HDF5_DIR to a parallel HDF5 built with this MPI" >&2
fi

if [ "${1:-}" != --packages ]; then
    cargo install --locked --path .
    . launch/env.sh
    echo "setup: installed $(command -v demhybrid)"
fi
