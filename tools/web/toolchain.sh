#!/usr/bin/env bash
# Finds or fetches the tools that building for browsers needs besides Rust and Node: a Rust for wasm32-unknown-unknown, and
# the wasm-bindgen command of exactly the version in Cargo.lock. Fetched tools lie in the build folder, in web-tools/.
#
#   tools/web/toolchain.sh    prints shell code to `eval`: STRIVEC_WEB_CARGO (arguments after `cargo rustc`), PATH, and for
#                             Debian's toolchain RUSTC and RUSTC_BOOTSTRAP
#
# A Rust that has the target is used as it is; else rustup adds the target; else, on Debian 12, the packages that Debian
# builds its browsers with are unpacked (they conflict with the distribution's own rustc, so they are not installed).
# STRIVEC_WEB_DEBIAN=1 uses these in any case. STRIVEC_NO_INSTALL=1 fails instead of fetching anything.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

target=wasm32-unknown-unknown
tools=${CARGO_TARGET_DIR:-$PWD/target}/web-tools
mkdir -p "$tools"

say() { printf 'toolchain: %s\n' "$*" >&2; }
fail() {
    say "$@"
    exit 1
}
may_install() { [[ -z ${STRIVEC_NO_INSTALL:-} ]] || fail "missing: $*"; }
as_root() { if ((EUID == 0)); then "$@"; else sudo "$@"; fi; }
command -v cargo >/dev/null || fail "cargo is missing: install Rust, see https://rustup.rs"

has_target() { compgen -G "$("${RUSTC:-rustc}" --print target-libdir --target "$target" 2>/dev/null)/libstd-*.rlib" >/dev/null; }

debian_version() { apt-cache policy rustc-web | sed -n 's/^ *Candidate: \([0-9]*\.[0-9]*\)\..*/\1/p'; }

# Debian's rustc for browsers. Its programs need its own libraries; its std is built from source.
unpack_debian() {
    local debian=$tools/debian list="rustc-web rust-web-src libstd-rust-web-dev" version package library
    if [[ ! -x $debian/rustc ]]; then
        command -v apt-get >/dev/null && command -v dpkg >/dev/null || return 1
        version=$(debian_version)
        # Images of containers have no lists of packages.
        [[ -n $version ]] || { as_root apt-get update -qq >&2 && version=$(debian_version); }
        [[ -n $version ]] || return 1
        say "fetching Debian's rustc-web $version into $debian"
        library=$(apt-cache depends "libstd-rust-web-$version" | sed -n '/libllvm[0-9]/{s/.*Depends: //p;q}')
        rm -rf "$debian.part"
        mkdir -p "$debian.part"
        for package in $list "libstd-rust-web-$version" $library; do
            (cd "$debian.part" && apt-get download -qq "$package" >&2) || return 1
        done
        for package in "$debian.part"/*.deb; do
            dpkg -x "$package" "$debian.part" && rm "$package"
        done
        rm -rf "$debian"
        mv "$debian.part" "$debian"
        prepare_debian "$debian"
    fi
    printf 'export RUSTC=%q RUSTC_BOOTSTRAP=1\n' "$debian/rustc"
    printf 'export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=%q\n' "$(cat "$debian/linker")"
    printf 'STRIVEC_WEB_CARGO=%q\n' "-Zbuild-std=std,panic_abort"
}

# Writes a `rustc` that finds its libraries, and the path of its linker.
prepare_debian() {
    local debian=$1 program=$1/usr/bin/rustc libraries source sysroot linker
    libraries=$(find "$debian" \( -name 'librustc_driver-*.so' -o -name 'libLLVM*.so*' \) -printf '%h\n' | sort -u | paste -sd:)
    source=$(find "$debian/usr/src" -path '*/library/Cargo.lock' -print -quit)
    [[ -x $program && -n $libraries && -n $source ]] || fail "Debian's rustc-web is not laid out as expected: $debian"
    # It brings no linker of its own.
    linker=$(find -L "$(rustc --print sysroot 2>/dev/null)/lib/rustlib" -name rust-lld -print -quit 2>/dev/null) || true
    linker=${linker:-$(command -v wasm-ld)} || fail "a linker for $target is missing: rust-lld of a Rust from rustup, or wasm-ld (lld)"
    printf '%s\n' "$linker" >"$debian/linker"
    {
        printf '#!/bin/sh\n'
        printf 'LD_LIBRARY_PATH=%q${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH} exec %q "$@"\n' "$libraries" "$program"
    } >"$debian/rustc"
    chmod +x "$debian/rustc"
    sysroot=$("$debian/rustc" --print sysroot)
    mkdir -p "$sysroot/lib/rustlib/src"
    ln -sfn "$(dirname "$(dirname "$source")")" "$sysroot/lib/rustlib/src/rust"
}

if [[ -n ${STRIVEC_WEB_DEBIAN:-} ]]; then
    [[ -x $tools/debian/rustc ]] || may_install "Debian's rustc-web"
    unpack_debian || fail "Debian's rustc-web cannot be fetched here"
elif has_target; then
    say "$(rustc --version) has $target"
elif [[ -x $tools/debian/rustc ]]; then
    unpack_debian
elif may_install "a Rust for $target" && command -v rustup >/dev/null && rustup target add "$target" >&2; then
    say "rustup added $target"
elif ! unpack_debian; then
    fail "no Rust for $target: rustup target add $target, or a Debian 12 whose security archive can be reached"
fi

version=$(sed -n '/^name = "wasm-bindgen"$/{n;s/^version = "\(.*\)"$/\1/p}' Cargo.lock)
[[ -n $version ]] || fail "Cargo.lock names no wasm-bindgen"
if [[ "$(wasm-bindgen --version 2>/dev/null)" == "wasm-bindgen $version" ]]; then
    say "wasm-bindgen $version is installed"
else
    program=$tools/bin/wasm-bindgen
    if [[ "$("$program" --version 2>/dev/null)" != "wasm-bindgen $version" ]]; then
        may_install "wasm-bindgen $version"
        say "building wasm-bindgen $version, which takes some minutes"
        # Optimizing the program takes longer than running it once.
        install=(cargo install wasm-bindgen-cli --version "$version" --bin wasm-bindgen --root "$tools" --force --debug)
        # With its own lock file first; if the registry lacks one of those versions, with any that fit.
        (export CARGO_TARGET_DIR=$tools/build CARGO_PROFILE_DEV_DEBUG=false && { "${install[@]}" --locked >&2 || "${install[@]}" >&2; }) ||
            fail "wasm-bindgen $version cannot be built: ${install[*]}"
        rm -rf "$tools/build"
    fi
    printf 'export PATH=%q:"$PATH"\n' "$tools/bin"
fi
