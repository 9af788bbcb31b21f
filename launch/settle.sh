#!/usr/bin/env bash
# Sets demhybrid up and settles the paper's bed of 200 spheres on 2 MPI ranks.
#   launch/settle.sh [SCENE] [options of demhybrid]
# SCENE is settle (left out), bed, bounce, quick or wide of configs/, or settle-basic, settle-friction or
# paper/settle of configs/paper/, which has the published solver. The scene is copied to the working folder,
# where the result appears too. RANKS=4 asks for 4 ranks.
set -euo pipefail
project="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"

scene=settle
if [ $# -gt 0 ] && [ "${1#-}" = "$1" ]; then
    scene="$1"
    shift
fi
file="$project/configs/$scene.toml"
[ -f "$file" ] || file="$project/configs/paper/$scene.toml"
[ -f "$file" ] || {
    echo "settle.sh: there is no scene $scene in $project/configs" >&2
    exit 2
}
name="${scene//\//-}" # paper-settle is another run than settle

# Whether the result gets the usual name. One that is there is refused now, and not after a build.
case " $* " in
*" -o"* | *" --out"* | *" --dry-run "* | *output.file*) usual=no ;;
*) usual=yes ;;
esac
if [ $usual = yes ] && [ -e "$name.vtkhdf" ] && [[ " $* " != *" --force "* ]]; then
    echo "settle.sh: $name.vtkhdf is there already: add --force to replace it" >&2
    exit 2
fi

path="$PATH"
"$project/launch/setup.sh"
. "$project/launch/env.sh"
[ -f "$name.toml" ] || cp "$file" "$name.toml"
[ "$name" != bounce ] || [ -f bounce.csv ] || cp "$project/configs/bounce.csv" .
mpirun -n "${RANKS:-2}" demhybrid "$name.toml" "$@"

[ $usual = yes ] || exit 0
echo
echo "settle.sh: the result is in $name.vtkhdf. What next?"
[ "$path" = "$PATH" ] || echo "  . $project/launch/env.sh    # once in this shell, to find demhybrid"
echo "  demhybrid analyze $name.vtkhdf    # how dense it is, with figures and a report in $name-analysis/"
echo "  demhybrid render $name.vtkhdf -o $name.png    # a picture"
echo "  demhybrid render $name.vtkhdf -o $name.gif --frame all --size 480x480    # how it fell"
