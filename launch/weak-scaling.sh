#!/usr/bin/env bash
#SBATCH --job-name=demhybrid-weak
#SBATCH --ntasks=8
#SBATCH --cpus-per-task=4
#SBATCH --time=02:00:00
# Weak scaling: as many particles on every rank, in a bed that grows wider with the number of ranks. CSV and SVG.
#   launch/weak-scaling.sh                    20 000 spheres a rank, on up to all cores of this machine
#   sbatch launch/weak-scaling.sh             the same on a cluster; the lines above and sbatch's options set the cores
# The bed of R ranks is R mirrored copies of the bed of one rank, side by side. Wider beds take a few more or fewer
# right-hand sides, so speed-up is particles x right-hand sides per second against those of the first number of ranks, by
# the solver's own seconds (wall_seconds of the output, without the start of MPI), and efficiency is speed-up over cores.
# Ranks are slabs across the longest axis, along which the bed grows, so each has as many ghosts as before.
# All turns must give the same bits, and the first bed of several ranks is computed on one rank too. Writes
# weak-scaling-runs.csv, weak-scaling.csv and weak-scaling.svg to the working folder.
#   SIZE=20000                   spheres a rank: 200, 2000 or 20000
#   RANKS="1 2"                  numbers of ranks (1, 2, 4, ... up to all tasks under Slurm, or all cores)
#   THREADS=1                    threads of each rank (SLURM_CPUS_PER_TASK under Slurm)
#   REPEATS, OURS, BEDS, LAUNCHER, SRUN_OPTIONS   as for strong-scaling.sh
set -euo pipefail
# sbatch runs a copy of this file: the project is where the job was submitted, or DEMHYBRID_PROJECT.
for here in "$(dirname "${BASH_SOURCE[0]}")" "${SLURM_SUBMIT_DIR:-}/launch" "${SLURM_SUBMIT_DIR:-}" "${DEMHYBRID_PROJECT:-}/launch"; do
    [ ! -f "$here/measure.sh" ] || break
done
[ -f "$here/measure.sh" ] || {
    echo "submit this from the folder of the project (with sbatch --chdir for the results), or set DEMHYBRID_PROJECT" >&2
    exit 1
}
# shellcheck source=launch/measure.sh
. "$here/measure.sh"

name=weak-scaling
each="${SIZE:-20000}"
threads="${THREADS:-${SLURM_CPUS_PER_TASK:-1}}"
read -r -a numbers <<<"${RANKS:-$(powers "$most_ranks" | tr '\n' ' ')}"
combos=("${numbers[@]/%/x$threads}")
shape "$each"
[ "$each" = "$base" ] || die "SIZE is 200, 2000 or 20000, not $each"
start "$name"

seconds="$(resting_time "$each")"
for ranks in "${numbers[@]}"; do
    wide "$each" "$ranks"
done
options_of() {
    wide "$each" "${1%x*}"
    from_file "$csv"
    options+=(--set "t_end=$seconds" --set "output.interval=$seconds")
}
case="$each spheres a rank"
race_combinations "$case" "$name" "$bed_toml"
for ranks in "${numbers[@]}"; do
    one_digest "$name" "$case" "$ranks"
done
for combo in "${combos[@]}"; do
    if [ "${combo%x*}" -gt 1 ]; then
        say "the bed of $combo once more on one rank"
        options_of "$combo"
        expected="$(awk -F, -v r="${combo%x*}" '$3 == r { print $10; exit }' "$name-runs.csv")"
        run_combination 1 "$threads" "$bed_toml" "${options[@]}"
        [ "$digest" = "$expected" ] || die "$combo gave $expected, one rank gave $digest"
        break
    fi
done
summarise "$name" "$case"
plot "$name" "Weak scaling"
