#!/usr/bin/env bash
# Builds the page into tools/web/dist: the library as WebAssembly, its bindings, the TypeScript around them. Prints what
# the wasm weighs, and fails where it weighs more than a page should.
#
#   tools/web/build.sh
#
# Needs Rust, Node 20.19 or later, npm; toolchain.sh sees to the rest.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
folder=$PWD

# Compressed bytes of wasm that a page may load.
most=1500000

./node-version.sh
exports=$(./toolchain.sh)
eval "$exports"
[[ -d node_modules && node_modules/.package-lock.json -nt package-lock.json ]] || npm ci --no-audit --no-fund

cd ../..
target=wasm32-unknown-unknown
cargo rustc ${STRIVEC_WEB_CARGO:-} --locked --lib --crate-type cdylib --profile web --target "$target" \
    --no-default-features --features web
cd "$folder"
wasm=${CARGO_TARGET_DIR:-../../target}/$target/web/strivec.wasm
rm -rf src/generated dist
wasm-bindgen --target web --out-dir src/generated "$wasm"
# What rustc may use for this target, and no more.
node_modules/.bin/wasm-opt -Oz --enable-bulk-memory --enable-mutable-globals --enable-nontrapping-float-to-int \
    --enable-reference-types --enable-sign-ext --enable-multivalue --enable-bulk-memory-opt \
    src/generated/strivec_bg.wasm -o src/generated/strivec_bg.wasm
node_modules/.bin/tsc
node_modules/.bin/vite build --logLevel warn
# What the package's users see of its types.
node_modules/.bin/tsc --noEmit false --declaration --emitDeclarationOnly --outDir dist/types

node - "$most" dist/assets/*.wasm <<'JS'
const { readFileSync } = require("node:fs");
const { brotliCompressSync, gzipSync } = require("node:zlib");
const [most, file] = process.argv.slice(2);
const bytes = readFileSync(file);
const [gzip, brotli] = [gzipSync(bytes, { level: 9 }).length, brotliCompressSync(bytes).length];
console.log(`${file}: ${bytes.length} bytes, ${gzip} by gzip, ${brotli} by brotli`);
if (gzip > Number(most)) {
  console.error(`build: more than ${most} bytes`);
  process.exit(1);
}
JS
