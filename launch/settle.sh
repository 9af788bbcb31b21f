#!/usr/bin/env bash
# Sets demhybrid up and settles the paper's bed of 200 spheres on 2 MPI ranks.
#   launch/settle.sh [settle|bed|settle-basic|settle-friction|bounce|quick] [options of demhybrid]
# The scene is copied to the working folder, where the result appears too. RANKS=4 asks for 4 ranks.
set -euo pipefail
project="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"

scene=settle
if [ $# -gt 0 ] && [ "${1#-}" = "$1" ]; then
    scene="$1"
    shift
fi
[ -f "$project/configs/$scene.toml" ] || {
    echo "settle.sh: there is no scene $scene in $project/configs" >&2
    exit 2
}

"$project/launch/setup.sh"
. "$project/launch/env.sh"
[ -f "$scene.toml" ] || cp "$project/configs/$scene.toml" .
[ "$scene" != bounce ] || [ -f bounce.csv ] || cp "$project/configs/bounce.csv" .
exec mpirun -n "${RANKS:-2}" demhybrid "$scene.toml" "$@"
