#!/usr/bin/env bash
# Builds the programs for one target and packs what is published of them: an archive with the programs, licenses and notices of
# third parties, and a bill of materials (CycloneDX).
#
#   tools/release.sh [options]
#     --target TRIPLE     target of the programs [default: this machine's]
#     --features LIST     features beside the default ones; empty leaves out strivec-player [default: player]
#     --binaries FOLDER   packs the programs in this folder and builds nothing
#     --wheel             builds the Python wheel, too; needs maturin. The page in tools/python/strivec/web becomes a part of it
#     --tag TAG           fails unless TAG is v and the version in Cargo.toml
#     --output FOLDER     folder for the results, created if absent [default: target/published]
#
# Environment: PYTHON names another program than python3; at least 3.11.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

fail() {
    printf 'release: %s\n' "$*" >&2
    exit 1
}

python=${PYTHON:-python3}
target=$(rustc -vV | sed -n 's/^host: //p')
host=$target
features=player
binaries=
wheel=false
tag=
output=${CARGO_TARGET_DIR:-target}/published
while (($#)); do
    case $1 in
    --wheel) wheel=true ;;
    --target | --features | --binaries | --tag | --output)
        (($# > 1)) || fail "$1 needs a value"
        printf -v "${1#--}" %s "$2"
        shift
        ;;
    -h | --help)
        sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"
        exit
        ;;
    *) fail "unknown argument $1; see --help" ;;
    esac
    shift
done

version=$(sed -n '/^\[workspace.package\]/,/^$/s/^version = "\(.*\)"$/\1/p' Cargo.toml)
[[ -z $tag || $tag == "v$version" ]] || fail "the tag is $tag; expected v$version, the version in Cargo.toml"

programs=(strivec strivec-pack)
[[ ,$features, != *,player,* ]] || programs+=(strivec-player)
ending=.tar.gz
suffix=
if [[ $target == *-windows-* ]]; then
    ending=.zip
    suffix=.exe
fi

if [[ -z $binaries ]]; then
    cargo build --locked --release --target "$target" ${features:+--features "$features"} "${programs[@]/#/--bin=}"
    binaries=${CARGO_TARGET_DIR:-target}/$target/release
    # Programs of another target cannot be tried here.
    if [[ $target == "$host" ]]; then
        for program in "${programs[@]}"; do "$binaries/$program$suffix" --version; done
        "$binaries/strivec$suffix" verify fixtures/v1/everything.strivec
    fi
fi
files=(README.md CHANGELOG.md SECURITY.md LICENSE-MIT LICENSE-APACHE)
for program in "${programs[@]}"; do
    [[ -f $binaries/$program$suffix ]] || fail "$binaries/$program$suffix is missing"
    files+=("$binaries/$program$suffix")
done

mkdir -p "$output"
name=strivec-$version-$target
chosen=(--target "$target" --features "$features")
notices=$output/THIRD-PARTY-NOTICES.txt
"$python" tools/notices.py "${chosen[@]}" --output "$notices"
"$python" tools/sbom.py "${chosen[@]}" --output "$output/$name.cdx.json"
"$python" tools/archive.py "$output/$name$ending" "${files[@]}" "$notices"
rm "$notices"

if $wheel; then
    chosen=(--target "$target" --package strivec-python)
    "$python" tools/notices.py "${chosen[@]}" --output tools/python/strivec/THIRD-PARTY-NOTICES.txt
    "$python" tools/sbom.py "${chosen[@]}" --output "$output/strivec-python-$version-$target.cdx.json"
    "$python" -m maturin build --locked --release --target "$target" --manifest-path tools/python/Cargo.toml --out "$output"
fi
ls -l "$output"
