# shellcheck shell=bash
# What batch scripts have in common: one part of a run, and what to do after it. To be sourced.

# Whether SIGUSR1 came, with which the batch system announces the end of the job.
announced=no
# Arguments of every part.
every_part=()

# run_part OUTPUT SCENE [ARGUMENT...]: runs SCENE to OUTPUT, or, where OUTPUT is there already, goes on with
# it, under `$LAUNCHER` (such as mpirun -n 4). The arguments in the array `every_part` (such as --set
# limits.wall=...) go to every part, the others to the first one, which records them. SIGUSR1 to this shell
# makes the run save itself and stop. Returns the exit code of the program: 0 done, 5 saved and stopped.
run_part() {
    local output="$1" scene="$2" part='' code=0
    shift 2
    trap 'announced=yes; [ -z "$part" ] || kill -USR1 "$part" 2>/dev/null || true' USR1
    if [ -e "$output" ]; then
        [ $# -eq 0 ] ||
            echo "demhybrid: $output is there: going on with it, with the arguments it was begun with" >&2
        set -- --resume "$output"
    else
        set -- "$scene" -o "$output" "$@"
    fi
    $LAUNCHER demhybrid "$@" ${every_part[@]+"${every_part[@]}"} &
    part=$!
    [ "$announced" = no ] || kill -USR1 "$part" 2>/dev/null || true
    # A signal ends a wait early.
    while kill -0 "$part" 2>/dev/null; do
        wait "$part" || true
    done
    wait "$part" || code=$?
    trap - USR1
    return "$code"
}
