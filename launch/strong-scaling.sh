#!/usr/bin/env bash
#SBATCH --job-name=demhybrid-strong
#SBATCH --ntasks=8
#SBATCH --cpus-per-task=4
#SBATCH --time=02:00:00
# Strong scaling: the same work on more and more cores, as ranks x threads. Speed-up and parallel efficiency as CSV and SVG.
#   launch/strong-scaling.sh                  settled beds of 200 and 20 000 spheres on up to all cores of this machine
#   sbatch launch/strong-scaling.sh           the same on a cluster; the lines above and sbatch's options set the cores
#   launch/strong-scaling.sh scene.toml...    scenes of your own
# Every combination must give the same bits and counts; the script stops where one does not. Combinations take turns, and
# medians count. Speed-up compares the solver's own seconds (wall_seconds of the output, without the start of MPI);
# wall and user time of whole runs are in the CSV too. Efficiency is speed-up over the number of cores. Both refer to the
# first combination. Writes strong-scaling-runs.csv, strong-scaling.csv and strong-scaling.svg to the working folder.
#   SIZES="200 20000"            spheres: 200, 2000 or a multiple of 20000
#   COMBOS="1x1 1x2 2x1"         ranks x threads of a rank (powers of two up to all cores, see combinations below)
#   REPEATS=5
#   OURS="--set solver.tolerance=1e-2"   more options for demhybrid
#   BEDS=./beds                  where settled beds are kept
#   LAUNCHER="mpirun -n {ranks}" what starts ranks; under Slurm srun, with SRUN_OPTIONS="--mpi=pmix" or what your site wants
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

name=strong-scaling
read -r -a combos <<<"${COMBOS:-$(combinations)}"
cases=("$@")
[ $# -gt 0 ] || read -r -a cases <<<"${SIZES:-200 20000}"
start "$name"

options_of() { :; } # the same for all

for case in "${cases[@]}"; do
    if [ $# -gt 0 ]; then
        scene="$(realpath "$case")" options=()
        case="$(basename "$case" .toml)"
    else
        settled "$case"
        from_file "$csv"
        scene="$bed_toml"
        seconds="$(resting_time "$case")"
        options+=(--set "t_end=$seconds" --set "output.interval=$seconds")
        case="$case spheres"
    fi
    race_combinations "$case" "$name" "$scene"
    one_digest "$name" "$case"
    summarise "$name" "$case"
done
plot "$name" "Strong scaling"
