# shellcheck shell=bash
# What batch scripts have in common: one part of a run, and what to do after it. To be sourced.

# run_part OUTPUT SCENE [ARGUMENT...]: runs SCENE to OUTPUT, or goes on with OUTPUT where it is there already, under
# `$LAUNCHER` (such as mpirun -n 4). SIGUSR1 to this shell makes the run save itself and stop. Returns the exit code of the
# program: 0 done, 5 saved and stopped.
run_part() {
    local output="$1" scene="$2" part
    shift 2
    if [ -e "$output" ]; then
        # Whatever the arguments were is recorded in the file.
        $LAUNCHER demhybrid --resume "$output" &
    else
        $LAUNCHER demhybrid "$scene" -o "$output" "$@" &
    fi
    part=$!
    trap 'kill -USR1 "$part" 2>/dev/null || true' USR1
    local code=0
    # A signal ends a wait early.
    while :; do
        code=0
        wait "$part" || code=$?
        kill -0 "$part" 2>/dev/null || break
    done
    trap - USR1
    return "$code"
}
