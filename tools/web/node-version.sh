#!/usr/bin/env bash
# Fails with a message unless npm and Node 20.19 or later, or 22.12 or later, are installed: the page's tools need them.
set -euo pipefail
fail() {
    printf '%s: install Node 20.19 or later, see https://nodejs.org\n' "$*" >&2
    exit 1
}
for program in node npm; do
    command -v "$program" >/dev/null || fail "$program is missing"
done
version=$(node --version)
IFS=. read -r major minor _ <<<"${version#v}"
case $major in
20) ((minor >= 19)) ;;
22) ((minor >= 12)) ;;
*) ((major > 22)) ;;
esac || fail "node $version is too old"
