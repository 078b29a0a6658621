#!/usr/bin/env bash
# Every check of this project: formatting, lints, documentation, tests, with all features and with none.
#
#   tools/check.sh            run them all; the first that fails ends the run
#
# Needs Rust (version: rust-version in Cargo.toml) with rustfmt and clippy, a C compiler, and Python 3 ($PYTHON, else
# python3) with numpy and zstandard for the second reader. Installs nothing; what is built lies in target/. All builds share
# the release profile, so that each dependency is compiled once to run and once to be checked.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

fail() {
    printf 'check: %s\n' "$*" >&2
    exit 1
}

command -v cargo >/dev/null || fail "cargo is missing: install Rust, see https://rustup.rs"
for component in fmt clippy; do
    cargo "$component" --version >/dev/null 2>&1 ||
        fail "cargo $component is missing: rustup component add rustfmt clippy"
done
{ command -v cc || command -v gcc || command -v clang; } >/dev/null ||
    fail "a C compiler is missing: apt-get install gcc libc6-dev"

python=${PYTHON:-python3}
"$python" -c 'import numpy, zstandard' 2>/dev/null ||
    fail "$python has no numpy or zstandard: apt-get install python3-numpy python3-zstandard, or pip install ./tools/python"

step() {
    local start=$SECONDS
    printf '\n== %s\n' "$*"
    "$@" || fail "failed: $*"
    printf '== done in %d s\n' $((SECONDS - start))
}

export RUSTDOCFLAGS="-D warnings"
light=(--no-default-features)

step cargo fmt --check
step cargo clippy --locked --release --all-targets -- -D warnings
step cargo clippy --locked --release --all-targets "${light[@]}" -- -D warnings
step cargo doc --locked --release --no-deps
step cargo doc --locked --release --no-deps "${light[@]}"
step cargo test --locked --release
step cargo test --locked --release "${light[@]}"
step env PYTHONPATH=tools/python PYTHONDONTWRITEBYTECODE=1 "$python" -m unittest discover tools/python/tests

printf '\nAll checks passed in %d s.\n' "$SECONDS"
