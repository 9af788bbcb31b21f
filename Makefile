# Everyday commands. `make check` is what launch/test.sh and CI run.

.PHONY: check fmt lint test doc bench

check: fmt lint doc test

fmt:
	cargo fmt --check

lint:
	cargo clippy --locked --all-targets -- -D warnings

test:
	cargo test --locked

doc:
	RUSTDOCFLAGS="-D warnings" cargo doc --locked --no-deps

bench:
	cargo bench --locked
