#!/usr/bin/env bash
# Builds the page into tools/web/dist: the library as WebAssembly, its bindings, the TypeScript around them and the notices of
# third parties, and copies it for wheels to tools/python/strivec/web. Prints the compressed size of the WebAssembly, and fails
# if it exceeds the limit below.
#
#   tools/web/build.sh
#
# Needs Rust, Node 20.19 or later, npm, and Python 3.11 or later (PYTHON names another program than python3). toolchain.sh and
# npm fetch the rest, or fail if STRIVEC_NO_INSTALL is set.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
folder=$PWD

# Most gzip-compressed bytes of WebAssembly that the page may load.
max_bytes=1500000

./node-version.sh
exports=$(./toolchain.sh)
eval "$exports"
if ! [[ -d node_modules && node_modules/.package-lock.json -nt package-lock.json ]]; then
    [[ -z ${STRIVEC_NO_INSTALL:-} ]] || { echo "build: missing: npm ci in tools/web" >&2 && exit 1; }
    npm ci --no-audit --no-fund
fi

cd ../..
target=wasm32-unknown-unknown
cargo build ${STRIVEC_WEB_CARGO:-} --locked --package strivec-web --profile web --target "$target"
cd "$folder"
wasm=${CARGO_TARGET_DIR:-../../target}/$target/web/strivec_web.wasm
rm -rf src/generated dist
wasm-bindgen --target web --out-name strivec --out-dir src/generated "$wasm"
# Exactly the features that rustc uses for this target.
node_modules/.bin/wasm-opt -Oz --enable-bulk-memory --enable-mutable-globals --enable-nontrapping-float-to-int \
    --enable-reference-types --enable-sign-ext --enable-multivalue --enable-bulk-memory-opt \
    src/generated/strivec_bg.wasm -o src/generated/strivec_bg.wasm
node_modules/.bin/tsc
node_modules/.bin/vite build --logLevel warn
node_modules/.bin/vite build --logLevel warn --config vite.whole.config.ts
"${PYTHON:-python3}" ../notices.py --package strivec-web --target "$target" --output dist/THIRD-PARTY-NOTICES.txt
rm -rf ../python/strivec/web
cp -r dist ../python/strivec/web
# Type declarations for users of the package.
node_modules/.bin/tsc --noEmit false --declaration --emitDeclarationOnly --outDir dist/types

node - "$max_bytes" dist/assets/*.wasm <<'JS'
const { readFileSync } = require("node:fs");
const { brotliCompressSync, gzipSync } = require("node:zlib");
const [maxBytes, file] = process.argv.slice(2);
const bytes = readFileSync(file);
const [gzip, brotli] = [gzipSync(bytes, { level: 9 }).length, brotliCompressSync(bytes).length];
console.log(`${file}: ${bytes.length} bytes, ${gzip} by gzip, ${brotli} by brotli`);
if (gzip > Number(maxBytes)) {
  console.error(`build: more than ${maxBytes} bytes compressed by gzip`);
  process.exit(1);
}
JS
