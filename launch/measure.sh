# shellcheck shell=bash
# What strong-scaling.sh, weak-scaling.sh and compare-peers.sh share; sourced by them. Sets `project`, `python`,
# `demhybrid`, and the functions below. Everything that is written goes to the working folder.
project="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
bed_py="$project/benches/peers/bed.py"
bed_toml="$project/benches/peers/bed.toml"
beds="${BEDS:-$PWD/beds}" # settled beds, made once and kept

self="$(basename "$0" .sh)"
[ "$self" != slurm_script ] || self="${SLURM_JOB_NAME:-$self}" # the name that sbatch gives its copy

say() {
    printf '%s: %s\n' "$self" "$*" >&2
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

# Sets `base` (particles of one tile), `size` (side of its box, m), `columns` and `copies` (tiles along x and
# y).
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

# A settled bed of N particles at $beds/bedN.csv: settled N. Sets `csv`, `lx`, `ly`. 200, 2 000 and 20 000
# spheres fall for 1.5 s at a loose tolerance, which is nearly the end of their motion, and come to rest for
# another second at a tolerance of 1. More are mirrored copies of 20 000 side by side (see `tile` in bed.py),
# which have 0.1 s to come to rest at the seams.
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

# A settled bed of R tiles of N particles along x, N being 200, 2000 or 20000: wide N R. Sets `csv`, `lx`,
# `ly`.
wide() {
    shape "$1"
    copies=("$2" 1)
    box
    if [ "$2" = 1 ]; then
        settled "$1"
    else
        csv="$beds/bed$1x$2.csv"
        [ -f "$csv" ] || tiled "$1x$2"
    fi
}

# A bed named so from `copies` of the settled bed of `base` particles, at `csv`: tiled NAME
tiled() {
    local target="$csv" tiles="$beds/tiles$1.csv" wide=("${copies[@]}")
    settled "$base"
    copies=("${wide[@]}") csv="$target"
    box
    say "tiling ${copies[0]} x ${copies[1]} beds of $base spheres, kept in $csv"
    bed tile "$beds/bed$base.csv" "$tiles" --size "$size" "$size" --copies "${copies[@]}"
    rest "$1" "$tiles" 0.1
    rm "$tiles"
}

# Lets the particles of a file come to rest at `csv`: rest NAME FILE SECONDS.
rest() {
    from_file "$2"
    prepare "$beds/rest$1.vtkhdf" "${options[@]}" --set "t_end=$3" --set "output.interval=$3" --set solver.tolerance=1
    bed csv "$beds/rest$1.vtkhdf" "$csv.part"
    mv "$csv.part" "$csv"
    rm "$beds/rest$1".vtkhdf*
}

# Simulated time for a settled bed of N particles that gives a measurement of a few seconds to a minute on one
# core: about 1 500 right-hand sides, most of them in the first 0.05 s, and fewer for the largest beds.
resting_time() {
    case "$1" in
    200) echo 20 ;;
    2000) echo 3 ;;
    *) if [ "$1" -le 100000 ]; then echo 0.3; else echo 0.05; fi ;;
    esac
}

# The processor, as its maker calls it.
processor() {
    sed -n 's/^model name[^:]*: //p' /proc/cpuinfo 2>/dev/null | head -n 1
}

# --- ranks x threads ---

# Cores of this job: SLURM_NTASKS ranks of SLURM_CPUS_PER_TASK cores under Slurm, or all cores of this machine
# in any way.
if [ -n "${SLURM_JOB_ID:-}" ]; then
    most_ranks="${SLURM_NTASKS:-1}" most_threads="${SLURM_CPUS_PER_TASK:-1}"
    cores=$((most_ranks * most_threads))
else
    cores="$(nproc)"
    most_ranks="$cores" most_threads="$cores"
fi

# 1, 2, 4, ... and the number given.
powers() {
    local n
    for ((n = 1; n < $1; n *= 2)); do
        echo "$n"
    done
    echo "$1"
}

# All combinations of such numbers of ranks and threads that fit into the cores, few cores first.
combinations() {
    local ranks threads
    for ranks in $(powers "$most_ranks"); do
        for threads in $(powers "$most_threads"); do
            [ $((ranks * threads)) -gt "$cores" ] || echo "$((ranks * threads)) ${ranks}x$threads"
        done
    done | sort -n -k 1,1 -s | awk '{ printf "%s ", $2 }'
}

# Starts the command on ranks with cores for their threads: on_ranks RANKS THREADS COMMAND...
on_ranks() {
    local ranks="$1" threads="$2" launcher
    shift 2
    if [ -n "${LAUNCHER:-}" ]; then
        read -r -a launcher <<<"${LAUNCHER//\{ranks\}/$ranks}"
        launcher=("${launcher[@]//\{threads\}/$threads}")
    elif [ -n "${SLURM_JOB_ID:-}" ]; then
        read -r -a launcher <<<"srun --ntasks=$ranks --cpus-per-task=$threads --exact ${SRUN_OPTIONS:-}"
    else
        launcher=(mpirun -n "$ranks")
    fi
    RAYON_NUM_THREADS="$threads" "${launcher[@]}" "$@"
}

# What the functions below use, and `options_of COMBINATION`, with which the script sets `options` of a run.
repeats="${REPEATS:-5}" combos=() ours=() work=
read -r -a ours <<<"${OURS:-}"
trap '[ -z "$work" ] || rm -rf "$work"' EXIT

# Says what is going to run and starts the files of results: start NAME
start() {
    work="$(mktemp -d "$PWD/$1.XXXXXX")" # in a folder that all nodes of a cluster see
    echo "case,particles,ranks,threads,turn,wall_s,user_s,solver_s,rhs_evaluations,digest,load" >"$1-runs.csv"
    echo "case,particles,ranks,threads,cores,repeats,wall_s,user_s,solver_s,rhs_evaluations,speedup,efficiency,digest,load_before,load_after" \
        >"$1.csv"
    say "ranks x threads ${combos[*]}; $("$demhybrid" --version | sed -n 1p); $(processor); load $(load)"
    if load | awk '{ exit !($1 > 0.5) }'; then
        say "this machine is busy: on cores that others use too, speed-up means nothing"
    fi
}

# Runs demhybrid once: sets wall, user (of all ranks), solver (its own wall time), rhs, digest, particles.
# Every rank notes its user time itself: those that srun starts are no children of ours.
run_combination() { # RANKS THREADS SCENE OPTIONS...
    local ranks="$1" threads="$2"
    shift 2
    rm -f "$work"/user.* "$work/run.vtkhdf"
    # shellcheck disable=SC2016 # expands on the ranks
    timed "$work/log" on_ranks "$ranks" "$threads" bash -c '
        TIMEFORMAT=%U
        { time "${@:2}" 2>&3; } 3>&2 2>"$1/user.$HOSTNAME.$$"' rank "$work" \
        "$demhybrid" "$@" --threads "$threads" -q --force -o "$work/run.vtkhdf"
    user="$(cat "$work"/user.* | awk '{ s += $1 } END { print s }')"
    [ "$(cat "$work"/user.* | wc -l)" = "$ranks" ] || die "$ranks ranks were asked for, but $(cat "$work"/user.* | wc -l) ran"
    read -r rhs _ _ _ _ _ solver particles started < <(bed facts "$work/run.vtkhdf")
    [ "$started" = "${ranks}x$threads" ] ||
        die "asked for ${ranks}x$threads ranks x threads, but demhybrid ran on $started: does the launcher match its MPI?"
    digest="$(bed digest "$work/run.vtkhdf")"
}

# Runs all combinations by turns and notes every run in NAME-runs.csv: race_combinations CASE NAME SCENE
race_combinations() {
    local case="$1" name="$2" combo ranks threads
    load_before="$(load)"
    for ((turn = 1; turn <= repeats; turn++)); do
        for combo in "${combos[@]}"; do
            ranks="${combo%x*}" threads="${combo#*x}"
            options_of "$combo"
            run_combination "$ranks" "$threads" "$3" "${options[@]}" "${ours[@]}"
            say "$case, turn $turn of $repeats, $combo: $solver s, user time $user s, $rhs right-hand sides"
            echo "$case,$particles,$ranks,$threads,$turn,$wall,$user,$solver,$rhs,$digest,$(load)" >>"$name-runs.csv"
        done
    done
    load_after="$(load)"
}

# Stops unless all runs of a case, or of one number of ranks in it, gave the same bits: one_digest NAME CASE
# [RANKS]
one_digest() {
    local digests
    digests="$(awk -F, -v c="$2" -v r="${3:-}" '$1 == c && (r == "" || $3 == r) { print $10, "from " $9 " right-hand sides" }' \
        "$1-runs.csv" | sort | uniq -c)"
    [ "$(wc -l <<<"$digests")" = 1 ] || die "the runs of $2 differ, see column digest of $1-runs.csv:
$digests"
}

# Medians of a case with speed-up and efficiency, to NAME.csv and the terminal: summarise NAME CASE
# Speed-up is what the first combination takes for a right-hand side of a particle over what this one takes.
summarise() {
    local name="$1" case="$2" combo ranks threads first_rate='' first_cores row field
    printf '\n%s: load %s before, %s after\n' "$case" "$load_before" "$load_after"
    printf '  %6s %8s %10s %10s %10s %9s %9s %11s\n' ranks threads particles 'solver, s' 'wall, s' 'user, s' speed-up efficiency
    for combo in "${combos[@]}"; do
        ranks="${combo%x*}" threads="${combo#*x}"
        row=()
        for field in 6 7 8; do
            # shellcheck disable=SC2046 # a list of numbers
            row+=("$(median $(awk -F, -v c="$case" -v r="$ranks" -v t="$threads" -v f="$field" \
                '$1 == c && $3 == r && $4 == t { print $f }' "$name-runs.csv"))")
        done
        read -r particles rhs digest < <(awk -F, -v c="$case" -v r="$ranks" -v t="$threads" \
            '$1 == c && $3 == r && $4 == t { print $2, $9, $10 }' "$name-runs.csv" | tail -n 1)
        rate="$(awk -v n="$particles" -v e="$rhs" -v t="${row[2]}" 'BEGIN { printf "%.10g", n * e / t }')"
        [ -n "$first_rate" ] || first_rate="$rate" first_cores=$((ranks * threads))
        read -r speedup efficiency < <(awk -v a="$first_rate" -v b="$rate" -v c="$first_cores" -v p=$((ranks * threads)) \
            'BEGIN { printf "%.3f %.3f\n", b / a * c, b / a * c / p }')
        printf '  %6s %8s %10s %10.3f %10.3f %9.3f %9s %11s\n' "$ranks" "$threads" "$particles" "${row[2]}" "${row[0]}" \
            "${row[1]}" "$speedup" "$efficiency"
        echo "$case,$particles,$ranks,$threads,$((ranks * threads)),$repeats,${row[0]},${row[1]},${row[2]},$rhs,$speedup,$efficiency,$digest,$load_before,$load_after" \
            >>"$name.csv"
    done
}

# Speed-up and efficiency over cores from NAME.csv, a curve for each case and number of threads: plot NAME
# TITLE
plot() {
    local name="$1" title="$2" key keys curves='' quality='' number=0
    if ! command -v gnuplot >/dev/null; then
        say "no figure, because gnuplot is missing (on Debian: apt install gnuplot-nox); the numbers are in $name.csv"
        return
    fi
    keys="$(awk -F, 'NR > 1 && !seen[$1 "," $4]++ { print $1 "," $4 }' "$name.csv")"
    while IFS=, read -r key threads; do
        number=$((number + 1))
        awk -F, -v c="$key" -v t="$threads" 'NR > 1 && $1 == c && $4 == t { print $5, $11, $12 }' "$name.csv" | sort -n \
            >"$work/curve$number"
        local look="with linespoints linewidth 2 pointtype $((number + 3)) linecolor $number"
        curves+=", '$work/curve$number' using 1:2 $look title '$key, $threads thread$([ "$threads" = 1 ] || echo s) a rank'"
        quality+=", '$work/curve$number' using 1:3 $look notitle"
    done <<<"$keys"
    most="$(awk -F, 'NR > 1 && $5 > m { m = $5 } END { print m }' "$name.csv")"
    # The key has a row for every two curves, below the plots.
    local rows=$(((number + 2) / 2)) height bottom
    height=$((470 + 24 * rows))
    bottom="$(awk -v h="$height" -v r="$rows" 'BEGIN { print (60 + 24 * r) / h }')"
    gnuplot <<EOF
set terminal svg size 960,$height noenhanced font 'sans-serif,14' background '#ffffff'
set output '$name.svg'
set multiplot layout 1,2 title '$title' margins 0.1,0.98,$bottom,0.92 spacing 0.1,0
set grid linecolor '#dddddd'
set key at screen 0.1,screen 0.01 bottom left reverse Left maxrows $rows samplen 2
set logscale xy 2
set format x '%.0f'
set xrange [0.9:$most*1.1]
set xlabel 'cores'
set ylabel 'speed-up'
plot x with lines dashtype 2 linecolor '#888888' title 'ideal'$curves
unset key
unset logscale y
set ylabel 'parallel efficiency'
set yrange [0:1.2]
plot 1 with lines dashtype 2 linecolor '#888888' notitle$quality
unset multiplot
EOF
    say "wrote $name.csv and $name.svg"
}
