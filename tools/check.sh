#!/usr/bin/env bash
# Every check of this project: formatting, lints, documentation, tests, with all features and with none.
#
#   tools/check.sh            run them all; the first that fails ends the run
#
# Needs Rust (version: rust-version in Cargo.toml) with rustfmt and clippy, a C compiler, a Vulkan driver (Mesa's lavapipe will
# do), Xvfb, Python 3 ($PYTHON, else python3) with numpy and zstandard for the second reader and Xlib for the window's
# events, and for the page Node (20.19 or later) with npm and Chromium ($CHROMIUM, else /usr/bin/chromium). Installs nothing;
# what is built lies in target/ and tools/web/, what the page's build fetches too. All builds share the release profile, so
# that each dependency is compiled once to run and once to be checked.
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
"$python" -c 'import numpy, zstandard, Xlib' 2>/dev/null ||
    fail "$python lacks a package: apt-get install python3-numpy python3-zstandard python3-xlib, or pip install them"
command -v Xvfb >/dev/null || fail "Xvfb is missing: apt-get install xvfb"
ls /usr/share/vulkan/icd.d/*.json >/dev/null 2>&1 || [[ -n ${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-} ]] ||
    fail "no Vulkan driver was found: apt-get install mesa-vulkan-drivers"
tools/web/node-version.sh || fail "Node, which the page is built with, is missing or too old"
[[ -x ${CHROMIUM:-/usr/bin/chromium} ]] || fail "Chromium is missing: apt-get install chromium, or set CHROMIUM"

step() {
    local start=$SECONDS
    printf '\n== %s\n' "$*"
    "$@" || fail "failed: $*"
    printf '== done in %d s\n' $((SECONDS - start))
}

export RUSTDOCFLAGS="-D warnings"
light=(--no-default-features)
whole=(--features player)
target=${CARGO_TARGET_DIR:-target}

step cargo fmt --check
step cargo clippy --locked --release --all-targets "${whole[@]}" -- -D warnings
step cargo clippy --locked --release -- -D warnings
step cargo clippy --locked --release --all-targets "${light[@]}" -- -D warnings
step cargo doc --locked --release --no-deps "${whole[@]}"
step cargo doc --locked --release --no-deps "${light[@]}"
step cargo test --locked --release "${whole[@]}"
for renderer in gpu cpu memory; do
    step "$python" tools/player/drive.py "$target/release/strivec-player" fixtures/v1/occupancy.strivec --renderer "$renderer"
done
step cargo test --locked --release "${light[@]}"
step env PYTHONPATH=tools/python PYTHONDONTWRITEBYTECODE=1 "$python" -m unittest discover tools/python/tests
step tools/web/build.sh
step npm --prefix tools/web test

printf '\nAll checks passed in %d s.\n' "$SECONDS"
