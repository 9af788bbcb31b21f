#!/usr/bin/env bash
# The long checks: the paper's beds to t = 8 s with their volume fractions and step counts, the user time of both on
# one core, and 20 000 particles on 2 ranks. Takes about ten minutes; prints the figures.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

launch/setup.sh
. launch/env.sh

echo "== packing: step counts, volume fractions, walls"
cargo test --locked --features long-tests --test packing -- --nocapture

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

echo "== user time on one core (targets: settle-basic 6 s, settle 120 s)"
for scene in settle-basic settle; do
    ( cd "$work" && time demhybrid "$OLDPWD/configs/$scene.toml" --threads 1 -q )
done

echo "== 20 000 particles in a wide box on 2 ranks"
( cd "$work" && time mpirun -n 2 demhybrid "$OLDPWD/configs/wide.toml" -q )
