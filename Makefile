# Everyday commands. `make check` is what launch/test.sh and CI run, `make quick` what to run while you work.

.PHONY: check quick fmt lint test doc bench

check: fmt lint doc test

# The library, the physics, and what people write and read: no ranks, no program that is started, no fuzzing.
quick:
	cargo test --locked --lib --test physics --test texts -- --skip hard:: --skip fuzz::

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
