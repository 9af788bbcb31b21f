#!/usr/bin/env bash
# Pours heaps of 2000 spheres and prints their angles of repose, for coefficients of friction and of rolling
# resistance. A block of spheres, 13 x 13 wide, is let go above a plane.
#   launch/heap.sh                        a table: half an hour on two cores
#   COEFFICIENTS="0.5" ROLLING="0.1 0.2" launch/heap.sh
#   KAPPA=500 T_END=30                    stiffness (1/m), time (s); angles are at 10 s and at the end
# The angle is that of a line through the heights of the heap over the distance from its middle, between a
# fifth and four fifths of its top. A height is the volume of the spheres in a ring over its area and over 0.6.
set -euo pipefail
# shellcheck source=launch/measure.sh
. "$(dirname "${BASH_SOURCE[0]}")/measure.sh"

coefficients="${COEFFICIENTS:-0.05 0.1 0.2 0.3 0.5 0.8}" rollings="${ROLLING:-0.05 0.2 0.8}"
kappa="${KAPPA:-500}" t_end="${T_END:-30}"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

# The block, with shifts that are drawn alike everywhere.
awk 'BEGIN {
    print "x,y,z"
    seed = 1
    for (n = 0; n < 2000; n++) {
        i = n % 13; j = int(n / 13) % 13; k = int(n / 169)
        for (c = 0; c < 3; c++) { seed = (seed * 16807) % 2147483647; shift[c] = 0.02 * seed / 2147483647 - 0.01 }
        printf "%.6f,%.6f,%.6f\n", (i - 6) * 0.23 + shift[0], (j - 6) * 0.23 + shift[1], 0.2 + k * 0.23 + shift[2]
    }
}' >"$work/block.csv"
cat >"$work/heap.toml" <<TOML
t_end = $(float "$t_end")
gravity = [0.0, 0.0, -9.81]
particles = { radius = 0.1, mass = 1.0, file = "block.csv" }
container.wall = [{ point = [0.0, 0.0, 0.0], normal = [0.0, 0.0, -1.0] }]
friction = { law = "history", coefficient = 0.5, rolling = { coefficient = 0.2 }, twisting = { coefficient = 0.02 } }
output.interval = 10.0
[contact]
repulsion_at_contact = 10.0
stiffness_exponent = $(float "$kappa")
restitution = 0.4
dissipation_focusing = 10.0
interaction_distance = 0.03
TOML

# Angle of repose in degrees of the spheres in a CSV file.
angle() {
    awk -F, -v r=0.1 -v wide=0.15 '
        NR == 1 { for (c = 1; c <= NF; c++) column[$c] = c; next }
        { n++; x[n] = $column["x"]; y[n] = $column["y"]; a += x[n]; b += y[n] }
        END {
            a /= n; b /= n
            for (i = 1; i <= n; i++) { ring = int(sqrt((x[i] - a)^2 + (y[i] - b)^2) / wide); count[ring]++ }
            for (k = 0; k < 60; k++) h[k] = count[k] * 4 / 3 * r^3 / 0.6 / (wide^2 * (2 * k + 1))
            top = (count[0] + count[1] + count[2]) * 4 / 3 * r^3 / 0.6 / (9 * wide^2)
            for (k = 0; k < 60 && h[k] > 0.1 * top; k++)
                if (h[k] > 0.2 * top && h[k] < 0.8 * top) {
                    at = (k + 0.5) * wide; m++; s += at; t += h[k]; q += at^2; p += at * h[k]
                }
            if (m < 3) { print "nan"; exit }
            printf "%.2f\n", atan2(-(m * p - s * t), m * q - s^2) * 57.29577951308232
        }' "$1"
}

printf '%12s %9s %14s %14s %12s %14s\n' friction rolling 'at 10 s, deg' "at $t_end s, deg" 'user, s' 'right-hand sides'
for coefficient in $coefficients; do
    for rolling in $rollings; do
        timed "$work/log" "$demhybrid" "$work/heap.toml" -q --force -o "$work/heap.vtkhdf" \
            --set "friction.coefficient=$coefficient" --set "friction.rolling.coefficient=$rolling"
        for when in 10 "$t_end"; do
            "$demhybrid" export "$work/heap.vtkhdf" --to csv -o "$work/at-$when.csv" --frame "$((when / 10))" --force >"$work/export" 2>&1 || {
                cat "$work/export" >&2
                die "export failed"
            }
        done
        read -r sides < <(sed -n 's/.*right-hand sides *\([0-9]*\).*/\1/p' "$work/log")
        printf '%12s %9s %14s %14s %12s %14s\n' "$coefficient" "$rolling" "$(angle "$work/at-10.csv")" \
            "$(angle "$work/at-$t_end.csv")" "$user" "$sides"
    done
done
