#!/usr/bin/env bash
# The long checks: the paper's beds with their volume fractions and step counts, beds of any size, the user
# time of the paper's on one core, 20 000 particles on 2 ranks, the build without MPI, exports in LAMMPS and
# OVITO, the report in chromium, the commands of all pages as they stand, the book, and ten minutes of
# fuzzing.
# Takes an hour or so on 2 cores, as estimated; prints the figures, fails where one is out of its bounds.
#   launch/test-long.sh                        all parts, in this order:
#   launch/test-long.sh restart writers alone packing beds exports browser documents fuzz hard speed wide \
#       accuracy
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
exec 3>&1 4>&2
configs="$PWD/configs"
ovito="$PWD/target/ovito/bin/python"

# Says what begins, and when.
say() {
    echo "== after $((SECONDS / 60)) min: $*"
}

# Installs a Debian package unless the program that it brings is there.
from_debian() {
    local program="$1" package="$2" root=()
    if ! command -v "$program" >/dev/null; then
        [ "$(id -u)" = 0 ] || root=(sudo)
        "${root[@]}" apt-get update -q
        "${root[@]}" env DEBIAN_FRONTEND=noninteractive \
            apt-get install -q -y --no-install-recommends "$package"
    fi
}

# A Python with h5py, numpy and ovito, in a folder of its own.
with_ovito() {
    if ! "$ovito" -c 'import h5py, ovito' 2>/dev/null; then
        rm -rf target/ovito
        python3 -m venv target/ovito
        target/ovito/bin/pip install -q --disable-pip-version-check h5py numpy ovito
    fi
}

# Runs a command and fails if it takes more than the given seconds of user time.
within() {
    local limit="$1" user
    shift
    user="$({ TIMEFORMAT=%U && time "$@" >&3 2>&4; } 2>&1)"
    echo "user time $user s, at most $limit s"
    awk -v user="$user" -v limit="$limit" 'BEGIN { exit !(user <= limit) }'
}

restart() {
    say "restart: 20 ranks killed at random times, runs stopped at three times and taken up on 1 to 3 ranks"
    cargo test --locked --features long-tests --test program restart:: -- --nocapture --test-threads=1 2>&1 |
        grep --line-buffered -v '^t = '
}

writers() {
    say "writers: two processes and one file, 20 times each on one rank and on two"
    cargo test --locked --features long-tests --test program writers:: -- --nocapture --test-threads=1 2>&1 |
        grep --line-buffered -v '^t = '
}

alone() {
    say "the build for a laptop: no MPI, the bundled HDF5; its tests, and its bits beside those with MPI"
    # Its HDF5 is built by CMake 3.26 or later, which Debian 12 does not have.
    local cmake path="$PATH" build=(--locked --no-default-features --features bundled)
    cmake="$({ cmake --version 2>/dev/null || true; } | sed -n 's/^cmake version //p')"
    if [ "$(printf '3.26\n%s\n' "$cmake" | sort -V | head -n 1)" != 3.26 ]; then
        if ! [ -x target/cmake/bin/cmake ]; then
            python3 -m venv target/cmake
            target/cmake/bin/pip install -q --disable-pip-version-check cmake
        fi
        path="$PWD/target/cmake/bin:$PATH"
    fi
    # A folder of its own: the builds would replace each other's parts.
    local target="$PWD/target/without-mpi"
    PATH="$path" CARGO_TARGET_DIR="$target" cargo clippy "${build[@]}" --all-targets -- -D warnings
    PATH="$path" CARGO_TARGET_DIR="$target" cargo test "${build[@]}"
    if ldd "$target/debug/demhybrid" | grep -E 'libhdf5|libmpi'; then
        echo "test-long: the build without MPI wants libraries of the system" >&2
        exit 1
    fi
    DEMHYBRID_WITHOUT_MPI="$target/debug/demhybrid" \
        cargo test --locked --features long-tests --test program builds::
}

packing() {
    say "packing: step counts, volume fractions, walls"
    cargo test --locked --features long-tests --test physics packing:: -- --nocapture --test-threads=1
}

beds() {
    say "beds of 2 000 spheres of 5 micrometres, half a millimetre and half a metre, as init writes them"
    cargo test --locked --features long-tests --test program beds:: -- --nocapture --test-threads=1
}

exports() {
    say "exports in LAMMPS and OVITO"
    from_debian lmp lammps
    with_ovito
    LAMMPS="$(command -v lmp)" OVITO_PYTHON="$ovito" \
        cargo test --locked --features long-tests --test program lammps_and_ovito
}

browser() {
    say "the report in a browser"
    from_debian chromium chromium
    CHROMIUM="$(command -v chromium)" cargo test --locked --features long-tests --test program browser::
}

documents() {
    say "every command of README and book, as they stand, and the book itself"
    with_ovito
    DEMHYBRID_PYTHON="$ovito" \
        cargo test --locked --features long-tests --test program documents:: -- --nocapture --test-threads=1
    [ -x target/mdbook/bin/mdbook ] || cargo install --locked --root target/mdbook --version '^0.4' mdbook
    target/mdbook/bin/mdbook build docs
}

fuzz() {
    say "fuzzing of scenes and particle files: four campaigns, with seeds that a plain test does not have"
    FUZZ_SECONDS="${FUZZ_SECONDS:-150}" FUZZ_SEED="${FUZZ_SEED:-1000}" \
        cargo test --locked --test texts fuzz:: -- --test-threads=1
}

hard() {
    say "hard cases: a bed at rest for 1 000 s, a column of 1 000 spheres, what vibrates at kappa = 500"
    cargo test --locked --features long-tests --test physics hard::rest:: -- --nocapture --test-threads=1
}

speed() {
    say "user time on one core"
    within 6 demhybrid "$configs/paper/settle-basic.toml" --threads 1 -q
    within 120 demhybrid "$configs/paper/settle.toml" --threads 1 -q
}

wide() {
    say "20 000 particles in a wide box on 2 ranks"
    time mpirun -n 2 demhybrid "$configs/wide.toml" --threads 1 -q
}

accuracy() {
    say "what accuracy costs: statistics of the bed, paired with the published solver on ten starts"
    demhybrid accuracy "$configs/settle.toml" --studies ensemble --methods auto \
        --tolerances 1e-1,1e-2 --seeds 10 --until 2 --paper -q
    say "and positions at t = 0.6 s"
    demhybrid accuracy "$configs/settle.toml" --studies state --time 0.6 --seeds 5 --force -q
}

all=(restart writers alone packing beds exports browser documents fuzz hard speed wide accuracy)
parts=("$@")
[ $# -gt 0 ] || parts=("${all[@]}")
for part in "${parts[@]}"; do
    case " ${all[*]} " in
    *" $part "*) ;;
    *)
        echo "test-long: there is no part $part; the parts are ${all[*]}" >&2
        exit 2
        ;;
    esac
done

launch/setup.sh
. launch/env.sh
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
for part in "${parts[@]}"; do
    case "$part" in
    speed | wide | accuracy) pushd "$work" >/dev/null ;;
    *) pushd . >/dev/null ;;
    esac
    "$part"
    popd >/dev/null
done
say "passed: ${parts[*]}"
