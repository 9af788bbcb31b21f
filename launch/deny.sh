#!/usr/bin/env bash
# Licences, sources and versions of all dependencies, by the rules of deny.toml; and known vulnerabilities where the
# advisory database can be reached. Installs cargo-deny with cargo where it is missing, about three minutes of one core.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

version=0.20.2
if [ "$(cargo deny --version 2>/dev/null)" != "cargo-deny $version" ]; then
    cargo install cargo-deny --version "$version" --locked
fi

cargo deny --locked check licenses bans sources
if timeout 60 cargo deny fetch db 2>/dev/null; then
    cargo deny --locked check --disable-fetch advisories
else
    echo "deny: the advisory database cannot be reached: known vulnerabilities were NOT looked up" >&2
fi
