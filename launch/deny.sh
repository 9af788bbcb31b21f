#!/usr/bin/env bash
# Licences, sources and versions of all dependencies, by the rules of deny.toml; and known vulnerabilities
# where the advisory database can be reached. Installs cargo-deny with cargo where it is missing, about two
# minutes of one core.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

version=0.20.2
if [ "$(cargo deny --version 2>/dev/null)" != "cargo-deny $version" ]; then
    # A tool that cannot be had is no fault of the change; what it finds is.
    # It runs for three seconds even if it is not optimised.
    if ! timeout 900 cargo install --debug cargo-deny --version "$version" --locked; then
        echo "deny: cargo-deny cannot be installed: licences and sources were NOT checked" >&2
        exit 0
    fi
fi

cargo deny --locked check licenses bans sources
if timeout 60 cargo deny fetch db 2>/dev/null; then
    cargo deny --locked check --disable-fetch advisories
else
    echo "deny: the advisory database cannot be reached: known vulnerabilities were NOT looked up" >&2
fi
