# shellcheck shell=bash
# What strong-scaling.sh, weak-scaling.sh and compare-peers.sh share; sourced by them. Sets `project`, `python`,
# `demhybrid`, and the functions below. Everything that is written goes to the working folder.
# Under sbatch the script runs from a copy elsewhere, so the project is looked for where the job was submitted too.
for project in "$(dirname "${BASH_SOURCE[0]}")/.." "${SLURM_SUBMIT_DIR:-}" "${SLURM_SUBMIT_DIR:-}/.."; do
    [ -f "$project/benches/peers/bed.toml" ] && break
done
project="$(cd "$project" && pwd)"
bed_py="$project/benches/peers/bed.py"
bed_toml="$project/benches/peers/bed.toml"
beds="${BEDS:-$PWD/beds}" # settled beds, made once and kept

say() {
    printf '%s: %s\n' "$(basename "$0" .sh)" "$*" >&2
}

die() {
    say "$*"
    exit 1
}

# shellcheck source=launch/env.sh
. "$project/launch/env.sh"

demhybrid="${DEMHYBRID:-$(command -v demhybrid || true)}"
[ -n "$demhybrid" ] || die "demhybrid is not installed: run launch/setup.sh first, or set DEMHYBRID to the program"
demhybrid="$(command -v "$demhybrid" || true)"
[ -n "$demhybrid" ] || die "$DEMHYBRID is not a program"
demhybrid="$(realpath "$demhybrid")"

python=
for candidate in "${DEMHYBRID_PYTHON:-}" "$project/.venv/bin/python" python3; do
    if [ -n "$candidate" ] && "$candidate" -c 'import h5py, numpy' 2>/dev/null; then
        python="$candidate"
        break
    fi
done
[ -n "$python" ] || die "no Python with h5py and numpy: run launch/test.sh once, or
    python3 -m venv .venv && .venv/bin/pip install h5py numpy   (in $project, or set DEMHYBRID_PYTHON)"

bed() {
    "$python" "$bed_py" "$@"
}

# Runs a command with its output in a log; sets `wall` and `user` to its seconds.
timed() {
    local log="$1" seconds TIMEFORMAT='%R %U'
    shift
    seconds="$({ time "$@" >"$log" 2>&1; } 2>&1)" || {
        tail -n 20 "$log" >&2
        die "failed: $*"
    }
    # shellcheck disable=SC2034 # for the scripts that source this
    read -r wall user <<<"$seconds"
}

# The middle of the numbers given, the mean of the middle two of an even count.
median() {
    printf '%s\n' "$@" | sort -g | awk '{ v[NR] = $1 } END { print (v[int((NR + 1) / 2)] + v[int(NR / 2) + 1]) / 2 }'
}

# Load averages of this machine over 1, 5 and 15 minutes.
load() {
    cut -d ' ' -f 1-3 /proc/loadavg 2>/dev/null || echo unknown
}

# Sets `base` (particles of one tile), `size` (side of its box, m), `columns` and `copies` (tiles along x and y).
shape() {
    local tiles
    copies=(1 1)
    case "$1" in
    200) base=200 columns=4 ;;    # the paper's bed
    2000) base=2000 columns=10 ;; # 20 layers, like all larger ones
    *)
        [ $(($1 % 20000)) -eq 0 ] || die "beds have 200, 2000 or a multiple of 20000 particles, not $1"
        base=20000 columns=32 tiles=$(($1 / 20000))
        copies=("$tiles" 1)
        for ((y = 2; y * y <= tiles; y++)); do
            [ $((tiles % y)) -eq 0 ] && copies=($((tiles / y)) "$y")
        done
        ;;
    esac
    size="$(awk -v n="$columns" 'BEGIN { print n * 0.25 }')"
}

# Sets `lx` and `ly`, the sides in m of the box that `copies` tiles fill.
box() {
    read -r lx ly < <(awk -v s="$size" -v x="${copies[0]}" -v y="${copies[1]}" 'BEGIN { print s * x, s * y }')
}

# Options that make bed.toml the scene of a box of lx by ly m: from_grid COUNT, or from_file CSV.
from_grid() {
    options=(--set "particles.grid={count=$1,spacing=0.25,jitter=0.025,bottom=1.1,seed=1}")
    in_box
}
from_file() {
    options=(--set "particles.file=$(realpath "$1")")
    in_box
}
in_box() {
    options+=(--set "container.box={min=[0.0,0.0,0.0],max=[$(float "$lx"),$(float "$ly"),inf]}")
}
float() {
    awk -v x="$1" 'BEGIN { printf x == int(x) ? "%.1f\n" : "%.17g\n", x }'
}

# Runs a scene on all cores of this machine to prepare something: prepare OUTPUT OPTIONS...
prepare() {
    local output="$1"
    shift
    "$demhybrid" "$bed_toml" -q --force -o "$output" ${PREPARE_THREADS:+--threads "$PREPARE_THREADS"} "$@" \
        >"$output.log" 2>&1 || {
        cat "$output.log" >&2
        die "preparing $output failed"
    }
}

# A settled bed of N particles at $beds/bedN.csv: settled N. Sets `csv`, `lx`, `ly`.
# 200, 2 000 and 20 000 spheres fall for 1.5 s at a loose tolerance, which is nearly the end of their motion, and come to
# rest for another second at a tolerance of 1. More are mirrored copies of 20 000 side by side. Spheres at the seams
# then meet their own image where a wall was and overlap it twice as far, which 0.05 s put right.
settled() {
    shape "$1"
    box
    csv="$beds/bed$1.csv"
    if [ ! -f "$csv" ]; then
        mkdir -p "$beds"
        if [ "$1" = "$base" ]; then
            say "settling a bed of $1 spheres, kept in $csv"
            from_grid "$1"
            prepare "$beds/fall$1.vtkhdf" "${options[@]}" --set t_end=1.5 --set output.interval=0.5 --set solver.tolerance=10
            bed csv "$beds/fall$1.vtkhdf" "$beds/fall$1.csv"
            rest "$1" "$beds/fall$1.csv" 1
            rm "$beds/fall$1".*
        else
            tiled "$1"
        fi
    fi
}

# A bed of N particles from `copies` of the settled bed of `base` particles, at `csv`.
tiled() {
    local target="$csv" tiles="$beds/tiles$1.csv" wide=("${copies[@]}")
    settled "$base"
    copies=("${wide[@]}") csv="$target"
    box
    say "tiling ${copies[0]} x ${copies[1]} beds of $base spheres, kept in $csv"
    bed tile "$beds/bed$base.csv" "$tiles" --size "$size" "$size" --copies "${copies[@]}"
    rest "$1" "$tiles" 0.05
    rm "$tiles"
}

# Lets the particles of a file come to rest at `csv`: rest N FILE SECONDS.
rest() {
    from_file "$2"
    prepare "$beds/rest$1.vtkhdf" "${options[@]}" --set "t_end=$3" --set "output.interval=$3" --set solver.tolerance=1
    bed csv "$beds/rest$1.vtkhdf" "$csv.part"
    mv "$csv.part" "$csv"
    rm "$beds/rest$1".vtkhdf*
}

# Simulated time for a settled bed of N particles that gives a measurement of a few seconds to a minute on one core:
# about 1 500 right-hand sides, most of them in the first 0.05 s, and fewer for the largest beds.
resting_time() {
    case "$1" in
    200) echo 20 ;;
    2000) echo 1 ;;
    *) if [ "$1" -le 100000 ]; then echo 0.05; else echo 0.005; fi ;;
    esac
}

# The processor, as its maker calls it.
processor() {
    sed -n 's/^model name[^:]*: //p' /proc/cpuinfo 2>/dev/null | head -n 1
}
