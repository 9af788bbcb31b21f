#!/usr/bin/env bash
# A run on a cluster with PBS (OpenPBS, PBS Pro) that outlives its time limit: two minutes before the limit it
# saves itself, and submits itself again until the scene is done.
#
#     qsub -v SCENE=configs/bed.toml launch/pbs.sh
#     qsub -v SCENE=big.toml,ARGUMENTS="--set t_end=20" -l select=4:ncpus=32:mpiprocs=8:ompthreads=4 launch/pbs.sh
#     qsub -v SCENE=configs/bed.toml -J 1-10 launch/pbs.sh            # ten seeds: bed-1.vtkhdf ... bed-10.vtkhdf
#
# Ranks x threads: mpiprocs ranks a node with ompthreads threads each. DEMHYBRID_SETUP names a file to source
# first, with the modules of the site (docs/clusters.md).
#PBS -N demhybrid
#PBS -l select=1:ncpus=2:mpiprocs=2:ompthreads=1
#PBS -l walltime=01:00:00
#PBS -j oe
set -euo pipefail

cd "${PBS_O_WORKDIR:-$PWD}"
# shellcheck source=launch/job.sh
. "${DEMHYBRID_HOME:-$PWD}/launch/job.sh"
if [ -n "${DEMHYBRID_SETUP:-}" ]; then
    # shellcheck disable=SC1090
    . "$DEMHYBRID_SETUP"
fi

scene="${SCENE:?give the scene: qsub -v SCENE=configs/bed.toml launch/pbs.sh}"
output="${OUTPUT:-$(basename "$scene" .toml)${PBS_ARRAY_INDEX:+-$PBS_ARRAY_INDEX}.vtkhdf}"
# PBS announces nothing: every part has the limit of the job, less two minutes, counted from here.
asked() {
    qstat -f "${PBS_JOBID:-}" 2>/dev/null | sed -n "s/^ *$1 = //p" | head -n 1
}
wall="${WALL:-}"
if [ -z "$wall" ]; then
    IFS=: read -r hours minutes seconds <<<"$(asked Resource_List.walltime)"
    wall=$((10#${hours:-1} * 3600 + 10#${minutes:-0} * 60 + 10#${seconds:-0} - 120))
fi
every_part=(--set "limits.wall=$wall")
read -r -a arguments <<<"${ARGUMENTS:-}"
if [ -n "${PBS_ARRAY_INDEX:-}" ]; then
    arguments+=(--set "particles.grid.seed=$PBS_ARRAY_INDEX")
fi
export RAYON_NUM_THREADS="${OMP_NUM_THREADS:-1}"
ranks="$(wc -l <"${PBS_NODEFILE:-/dev/null}")"
[ "$ranks" -gt 0 ] || ranks=2
LAUNCHER="${LAUNCHER:-mpirun -n $ranks --map-by slot:PE=$RAYON_NUM_THREADS --bind-to core}"

code=0
run_part "$output" "$scene" ${arguments[@]+"${arguments[@]}"} || code=$?
# Whoever stopped the run by hand, with the file OUTPUT.stop, wants it to stay so.
if [ "$code" -eq 5 ] && [ "$SECONDS" -ge "$((wall - 5))" ] && [ -n "${PBS_JOBID:-}" ]; then
    echo "demhybrid: submitted again"
    # With the resources of this job; a site may want more, such as an account.
    qsub -l "select=$(asked Resource_List.select)" -l "walltime=$(asked Resource_List.walltime)" -q "$(asked queue)" \
        -v "SCENE=$scene,OUTPUT=$output,WALL=$wall,DEMHYBRID_SETUP=${DEMHYBRID_SETUP:-},DEMHYBRID_HOME=${DEMHYBRID_HOME:-$PWD}" \
        "${DEMHYBRID_HOME:-$PWD}/launch/pbs.sh"
fi
exit "$code"
