import { defineConfig } from "vite";

// Relative addresses: the folder works wherever it is put. The wasm stays a file of its own, so that it can be compiled
// while it arrives.
export default defineConfig({
  base: "./",
  build: { target: "es2022", assetsInlineLimit: 0, modulePreload: { polyfill: false } },
});
