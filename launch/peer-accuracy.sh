#!/usr/bin/env bash
# How far LAMMPS's fixed steps lead from the motion that its own equations give, beside demhybrid's steps.
#   launch/peer-accuracy.sh          minutes
# 200 spheres fall from the starts of configs/bed.toml to t = 0.6 s, when the bed has begun to collapse. For
# each step size the largest error of a position, against the smallest step; medians over the starts. LAMMPS
# computes Hertz contacts as soft as ours, see benches/peers/lammps-hertz.in. Ours is against dormand-prince
# at a tolerance of 1e-10.
#   SEEDS="1 2 3 4 5"                starts
#   STEPS="1e-3 5e-4 ..."            LAMMPS's steps, s; 1e-3 is the one of compare-peers.sh
#   REFERENCE=1e-6                   the step that counts as exact, s
#   TOLERANCES="1e-1,1e-2"           demhybrid's
#   DEMHYBRID=, LAMMPS=, DEMHYBRID_PYTHON=  programs, if not in PATH
set -euo pipefail
# shellcheck source=launch/measure.sh
. "$(dirname "${BASH_SOURCE[0]}")/measure.sh"

read -r -a seeds <<<"${SEEDS:-1 2 3 4 5}"
read -r -a steps <<<"${STEPS:-1e-3 5e-4 1e-4 1e-5 2e-6}"
reference="${REFERENCE:-1e-6}" end=0.6
scene="$project/configs/bed.toml"
deck="$project/benches/peers/lammps-hertz.in"
lammps="$(command -v "${LAMMPS:-lmp}" || command -v "${LAMMPS:-lmp_mpi}" || true)"
[ -n "$lammps" ] || die "LAMMPS is missing; on Debian: apt install lammps"

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
export OMP_NUM_THREADS=1

# Number of steps of this size.
count() { # DT
    awk -v end="$end" -v dt="$1" 'BEGIN { printf "%d", end / dt + 0.5 }'
}

# Leaves the state of LAMMPS at the end, from the start with this seed, with steps of this size.
lammps() { # SEED DT
    timed "$work/log" "$lammps" -in "$deck" -log none -var data "$work/$1.data" -var lx 1 -var ly 1 \
        -var young 6e5 -var skin 0.03 -var dt "$2" -var steps "$(count "$2")" -var last "$work/$1.$2"
}

for seed in "${seeds[@]}"; do
    timed "$work/log" "$demhybrid" "$scene" --threads 1 -q --force -o "$work/start.vtkhdf" \
        --set "particles.grid.seed=$seed" --set t_end=1e-6
    bed csv "$work/start.vtkhdf" "$work/start.csv" --frame 0
    bed lammps "$work/start.csv" "$work/$seed.data" --size 1 1
    lammps "$seed" "$reference"
done
printf 'LAMMPS: step (s), steps to %s s, largest error of a position (m)\n' "$end"
for dt in "${steps[@]}"; do
    errors=()
    for seed in "${seeds[@]}"; do
        lammps "$seed" "$dt"
        errors+=("$(bed apart "$work/$seed.$dt" "$work/$seed.$reference")")
    done
    printf '  %8s %8s %10.2g\n' "$dt" "$(count "$dt")" "$(median "${errors[@]}")"
done
printf 'demhybrid: tolerance, right-hand sides, largest error of a position (m)\n'
"$demhybrid" accuracy "$scene" --studies state --methods auto --tolerances "${TOLERANCES:-1e-1,1e-2}" \
    --time "$end" --seeds "${#seeds[@]}" --force -q -o "$work/accuracy" |
    awk '/^ +auto / { printf "  %8s %8s %10.2g\n", $2, $3, $5 }'
