#!/usr/bin/env bash
# Runs demhybrid, LAMMPS and LIGGGHTS by turns on one core and prints medians and ratios of user time.
#   QUICK=1 launch/compare-peers.sh      minutes: N = 2 000 at rest, N = 200 falling, once
#   launch/compare-peers.sh              all of it, five times: some hours
# throughput: N spheres lie in a settled bed of demhybrid's. Particle evaluations per second are N x right-hand sides
#   (ours) or N x time steps (theirs) over the user time of the whole process, start to end.
# settle: N spheres fall and come to rest, 8 s, from the same start. Ours writes a frame every 0.08 s, the others one.
# "demhybrid" has friction that remembers, with the coefficient that the others have; "demhybrid paper" the paper's.
# What each program computes is said in benches/peers/*.in. Every run goes to compare-peers-runs.csv, medians to
# compare-peers.csv in the working folder; beds are kept in ./beds. A program that is not installed is left out.
#   SIZES="2000 20000 200000"      particles at rest: 200, 2000 or a multiple of 20000 (empty: none)
#   SETTLE_SIZES="200 2000 20000"  particles that fall: 200, 2000, 20000 (empty: none)
#   REPEATS=5                      runs of each program, by turns
#   CORE=1                         the core to use (the last one allowed)
#   BEDS=./beds                    where settled beds are kept; PREPARE_THREADS=1 makes them on one core
#   SKIN_BUCK=0.01 SKIN_HERTZ=0.03 LAMMPS's and LIGGGHTS's neighbour skins, m: the fastest of 0.005 to 0.05 for N = 2 000
#   OURS="--set solver.tolerance=1e-2"  more options for demhybrid
#   DEMHYBRID=, LAMMPS=, LIGGGHTS=, DEMHYBRID_PYTHON=  programs, if not in PATH
set -euo pipefail
# shellcheck source=launch/measure.sh
. "$(dirname "${BASH_SOURCE[0]}")/measure.sh"

if [ "${QUICK:-0}" != 0 ]; then
    sizes="${SIZES-2000}" falls="${SETTLE_SIZES-200}" repeats="${REPEATS:-1}"
else
    sizes="${SIZES-2000 20000 200000}" falls="${SETTLE_SIZES-200 2000 20000}"
fi
skin_buck="${SKIN_BUCK:-0.01}" skin_hertz="${SKIN_HERTZ:-0.03}"
peers="$project/benches/peers"
out="$PWD"

lammps="$(command -v "${LAMMPS:-lmp}" || command -v "${LAMMPS:-lmp_mpi}" || true)"
liggghts="$(command -v "${LIGGGHTS:-liggghts}" || true)"
[ -n "$lammps" ] || say "LAMMPS is missing and left out; on Debian: apt install lammps"
[ -n "$liggghts" ] || say "LIGGGHTS is missing and left out; on Debian: apt install liggghts"

remembers=(--set 'friction={law="history",coefficient=0.345}')
core=()
if command -v taskset >/dev/null; then
    core=(taskset -c "${CORE:-$(taskset -cp $$ | sed 's/.*[^0-9]//')}")
fi
export OMP_NUM_THREADS=1 RAYON_NUM_THREADS=1

work="$(mktemp -d)"

# Each runs one program once and sets wall, user and evaluations (of every particle).
ours() {
    timed "$work/log" "${core[@]}" "$demhybrid" "$bed_toml" --threads 1 -q --force -o "$work/ours.vtkhdf" \
        "$@" "${ours[@]}"
    read -r evaluations _ < <(bed facts "$work/ours.vtkhdf")
}
resting_bed() {
    ours "${options[@]}" --set "t_end=$seconds" --set "output.interval=$seconds" "$@"
}
lammps() { # DECK STEPS DT VARIABLES...
    evaluations="$2"
    timed "$work/log" "${core[@]}" "$lammps" -in "$peers/$1" -log none -var data "$work/data" -var lx "$lx" -var ly "$ly" \
        -var steps "$2" -var dt "$3" -var last "$work/last" "${@:4}"
}
liggghts() { # STEPS DT VARIABLES...
    evaluations="$1"
    timed "$work/log" "${core[@]}" "$liggghts" -in "$peers/liggghts-hertz.in" -log "$work/peer.log" -var data "$work/data" \
        -var lx "$lx" -var ly "$ly" -var steps "$1" -var dt "$2" -var last "$work/last" "${@:3}"
    # It ends with 0 after an error.
    ! grep '^ERROR' "$work/log" >&2 || die "failed: LIGGGHTS"
}
run() {
    case "$1" in
    "throughput: demhybrid") resting_bed "${remembers[@]}" ;;
    "throughput: demhybrid paper") resting_bed ;;
    "throughput: LAMMPS buck") lammps lammps-buck.in "$steps" 2.5e-5 -var skin "$skin_buck" ;;
    "throughput: LAMMPS Hertz") lammps lammps-hertz.in "$steps" 1e-3 -var young 6e5 -var skin "$skin_hertz" ;;
    "throughput: LIGGGHTS Hertz") liggghts "$steps" 1e-3 -var young 6e5 -var skin "$skin_hertz" ;;
    "settle: demhybrid") ours "${options[@]}" "${remembers[@]}" ;;
    "settle: demhybrid paper") ours "${options[@]}" ;;
    "settle: LAMMPS Hertz soft") lammps lammps-hertz.in 8000 1e-3 -var young 6e5 -var skin "$skin_hertz" ;;
    "settle: LAMMPS Hertz stiff") lammps lammps-hertz.in 32000 2.5e-4 -var young 4e7 -var skin "$skin_hertz" ;;
    "settle: LIGGGHTS Hertz soft") liggghts 8000 1e-3 -var young 6e5 -var skin "$skin_hertz" ;;
    esac
}

# Runs the programs of one part by turns, then prints and stores the medians: race PART PARTICLES REMARK
race() {
    local part="$1" count="$2" programs=("$1: demhybrid" "$1: demhybrid paper") name i rate first before users=() walls=() done=()
    case "$part" in
    throughput)
        [ -z "$lammps" ] || programs+=("$part: LAMMPS buck" "$part: LAMMPS Hertz")
        [ -z "$liggghts" ] || programs+=("$part: LIGGGHTS Hertz")
        ;;
    settle)
        [ -z "$lammps" ] || programs+=("$part: LAMMPS Hertz soft" "$part: LAMMPS Hertz stiff")
        [ -z "$liggghts" ] || programs+=("$part: LIGGGHTS Hertz soft")
        ;;
    esac
    before="$(load)"
    for ((turn = 1; turn <= repeats; turn++)); do
        for i in "${!programs[@]}"; do
            name="${programs[$i]#*: }"
            run "${programs[$i]}"
            say "$part of $count, turn $turn of $repeats: $name $user s"
            echo "$part,$count,$name,$turn,$wall,$user,$evaluations,$(load)" >>"$out/compare-peers-runs.csv"
            users[i]+=" $user" walls[i]+=" $wall" done[i]="$evaluations"
        done
    done
    printf '\n%s of %s spheres: %s\nload %s before, %s after\n' "$part" "$count" "$3" "$before" "$(load)"
    printf '  %-22s %12s %12s %16s %14s\n' program 'user time, s' evaluations 'particles x ev/s' "ours : theirs"
    for i in "${!programs[@]}"; do
        # shellcheck disable=SC2086 # lists of numbers
        user="$(median ${users[$i]})" wall="$(median ${walls[$i]})" name="${programs[$i]#*: }"
        rate="$(awk -v n="$count" -v e="${done[$i]}" -v t="$user" 'BEGIN { printf "%.4g", n * e / t }')"
        # Of throughput more is better, of time to settle less.
        if [ "$i" = 0 ]; then
            if [ "$part" = throughput ]; then first="$rate"; else first="$user"; fi
        fi
        ratio="$(awk -v a="$first" -v r="$rate" -v t="$user" -v p="$part" \
            'BEGIN { printf "%.3g", a / (p == "throughput" ? r : t) }')"
        printf '  %-22s %12.2f %12s %16s %14s\n' "$name" "$user" "${done[$i]}" "$rate" "$ratio"
        echo "$part,$count,$name,$repeats,$wall,$user,${done[$i]},$rate,$ratio,$3,$before,$(load),$versions" \
            >>"$out/compare-peers.csv"
    done
}

versions="$("$demhybrid" --version | sed -n 1p)"
[ -z "$lammps" ] || versions+="; $({ "$lammps" -h || true; } | sed -n 's/^Large-scale.*Simulator - /LAMMPS /p')"
# It leaves a log in the folder where it runs.
[ -z "$liggghts" ] || versions+="; $(cd "$work" && { "$liggghts" -h || true; } 2>&1 | sed -n 's/.*(Version LIGGGHTS-PUBLIC \([^,]*\),.*/LIGGGHTS \1/p')"
echo "one core of $(processor); $versions; load $(load)"
echo "part,particles,program,turn,wall_s,user_s,evaluations,load" >"$out/compare-peers-runs.csv"
echo "part,particles,program,repeats,wall_s,user_s,evaluations,particle_evaluations_per_s,ours_to_theirs,remark,load_before,load_after,versions" \
    >"$out/compare-peers.csv"

for count in $sizes; do
    settled "$count"
    bed lammps "$csv" "$work/data" --size "$lx" "$ly"
    from_file "$csv"
    seconds="$(resting_time "$count")"
    steps=$((count <= 50000 ? 20000000 / count : 400))
    read -r _ near touching < <(bed neighbours "$csv")
    race throughput "$count" "$near neighbours within 0.3 m and $touching touching contacts of a sphere"
done

for count in $falls; do
    shape "$count"
    [ "$count" = "$base" ] || die "settle is for 200, 2000 and 20000 particles, not $count"
    box
    from_grid "$count"
    # The start as demhybrid draws it is frame 0 of a run that ends at once.
    prepare "$work/start.vtkhdf" "${options[@]}" --set t_end=1e-6
    bed csv "$work/start.vtkhdf" "$work/start.csv" --frame 0
    bed lammps "$work/start.csv" "$work/data" --size "$lx" "$ly"
    race settle "$count" "8 s from the grid of configs/settle.toml"
done
