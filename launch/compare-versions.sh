#!/usr/bin/env bash
# Compares this version of demhybrid with an earlier one: bits, user time, and what a change costs to compile.
#   launch/compare-versions.sh REVISION [PART]...      all parts if none is named
#   bits    both run the same scenes on ranks x threads; code 1 if a checksum of positions, velocities, spins,
#           counts or energies differs
#   time    both run by turns; median ratios of user time, new over old, and right-hand sides if they differ
#   build   CPU time after a change of one line in the contact law
# Both versions are built first, the earlier one in target/before. The scenes are those of this version.
#   TURNS=5               runs of each version in part time
#   SIZES="2000 20000"    settled beds in part time (empty: none)
#   BEDS=./beds           where settled beds are kept
set -euo pipefail
[ $# -gt 0 ] || {
    sed -n '2,12s/^# \?//p' "$0"
    exit 2
}
project="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
revision="$1"
shift
parts=" ${*:-bits time build} "

now="$project/target/release/demhybrid"
before="$project/target/before"
[ -d "$before/.git" ] || git clone -q "$project" "$before"
git -C "$before" fetch -q origin
git -C "$before" checkout -q --detach "$(git -C "$project" rev-parse "$revision")"
. "$project/launch/env.sh"
for tree in "$before" "$project"; do
    (cd "$tree" && cargo build --release --locked --target-dir "$tree/target")
done

export DEMHYBRID="$now"
# shellcheck source=launch/measure.sh
. "$project/launch/measure.sh"
old="$before/target/release/demhybrid"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

# The checksum of a run: digest PROGRAM RANKS THREADS SCENE OPTIONS...
digest() {
    local program="$1" ranks="$2" threads="$3" code=0
    shift 3
    on_ranks "$ranks" "$threads" "$program" "$@" -q --force --threads "$threads" -o "$work/run.vtkhdf" \
        >"$work/log" 2>&1 || code=$?
    [ -f "$work/run.vtkhdf" ] || die "no result of $program $*: $(tail -n 3 "$work/log")"
    echo "$(bed digest "$work/run.vtkhdf") code $code"
    rm "$work/run.vtkhdf"
}

bits() {
    local scene options expected found different=0 runs=0
    # Runs that would be long are cut short, after their first impacts.
    for scene in "paper/settle t_end=0.62" "bed t_end=1.0" "bed t_end=1.0 output.energy=true" \
        "paper/settle-basic t_end=1.5" "paper/settle-friction t_end=0.62" "quick t_end=1.5" "wide t_end=0.5" \
        bounce "$project"/tests/scenes/hard/*.toml; do
        read -r -a options <<<"$scene"
        scene="${options[0]}"
        options=("${options[@]:1}")
        options=("${options[@]/#/--set=}")
        [ -f "$scene" ] || scene="$project/configs/$scene.toml"
        expected="$(digest "$old" 1 1 "$scene" "${options[@]}")"
        for combination in "1 1" "1 2" "2 1" "3 2"; do
            # shellcheck disable=SC2086 # ranks and threads
            found="$(digest "$now" $combination "$scene" "${options[@]}")"
            runs=$((runs + 1))
            [ "$found" = "$expected" ] || {
                different=$((different + 1))
                say "other bits: $scene ${options[*]} on $combination: $found, not $expected"
            }
        done
    done
    echo "bits: $runs runs compared, $different differ"
    [ "$different" = 0 ]
}

# Prints the median ratio of user times, new over old: race NAME RANKS THREADS SCENE OPTIONS...
race() {
    local name="$1" ranks="$2" threads="$3" ratios=() users=() counts=() order program which
    shift 3
    for ((turn = 0; turn < ${TURNS:-5}; turn++)); do
        order=("$old" "$now")
        [ $((turn % 2)) = 0 ] || order=("$now" "$old")
        for program in "${order[@]}"; do
            timed "$work/log" on_ranks "$ranks" "$threads" "$program" "$@" -q --force --threads "$threads" \
                -o "$work/run.vtkhdf"
            if [ "$program" = "$old" ]; then which=0; else which=1; fi
            users[which]="$user"
            counts[which]="$(awk '$1 == "right-hand" { print $3 }' "$work/log")"
        done
        ratios+=("$(awk -v old="${users[0]}" -v new="${users[1]}" 'BEGIN { printf "%.3f", new / old }')")
    done
    printf '%-20s %s ranks x %s threads  last %6.2f and %6.2f s  ratio %s  (%s)' "$name" "$ranks" "$threads" \
        "${users[0]}" "${users[1]}" "$(median "${ratios[@]}")" "${ratios[*]}"
    [ "${counts[0]}" = "${counts[1]}" ] || printf '; right-hand sides %s and %s' "${counts[@]}"
    echo
}

race_all() {
    echo "user time, before and now, load $(load)"
    race "settle" 1 1 "$project/configs/settle.toml"
    race "settle, output.energy" 1 1 "$project/configs/settle.toml" --set output.energy=true
    race "paper/settle to 1 s" 1 1 "$project/configs/paper/settle.toml" --set t_end=1.0
    for count in ${SIZES-2000 20000}; do
        settled "$count"
        from_file "$csv"
        options+=(--set "t_end=$(resting_time "$count")" --set "output.interval=$(resting_time "$count")")
        race "$count at rest" 1 1 "$bed_toml" "${options[@]}"
        race "$count at rest" 1 2 "$bed_toml" "${options[@]}"
        race "$count at rest" 2 1 "$bed_toml" "${options[@]}"
    done
}

# CPU seconds of a command in a tree after a change of one line in the law: rebuild TREE COMMAND...
rebuild() {
    local law TIMEFORMAT='%U %S' seconds tree="$1"
    shift
    law="$(grep -rl --include=contact.rs 'fn action' "$tree/src" | head -n 1)"
    (cd "$tree" && "$@" >/dev/null 2>&1) || die "$* fails in $tree"
    cp "$law" "$work/contact.rs"
    trap 'cp "$work/contact.rs" "$law"' EXIT # here in the subshell of the caller
    sed -i '0,/let opening = dot::<A>(n, v_rel);/s//let opening = 1.0 * dot::<A>(n, v_rel);/' "$law"
    ! cmp -s "$law" "$work/contact.rs" || die "$law has no line that could be changed"
    seconds="$({ time (cd "$tree" && "$@" >"$work/log" 2>&1); } 2>&1)" || tail -n 5 "$work/log" >&2
    echo "$seconds"
}

build() {
    local command
    echo "CPU seconds after a change of one line in the law: user system"
    for command in "cargo build --release --locked" "cargo test --no-run --locked"; do
        for tree in "$before" "$project"; do
            # shellcheck disable=SC2086 # a command and its arguments
            printf '%-32s %-7s %s\n' "$command" "$([ "$tree" = "$before" ] && echo before || echo now)" \
                "$(rebuild "$tree" $command --target-dir "$tree/target")"
        done
    done
    ls -l "$old" "$now" | awk '{ print $5, "bytes", $9 }'
}

case "$parts" in *" bits "*) bits ;; esac
case "$parts" in *" time "*) race_all ;; esac
case "$parts" in *" build "*) build ;; esac
