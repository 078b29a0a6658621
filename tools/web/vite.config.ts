import { defineConfig } from "vite";

// Two ways in: the page, and the custom element as a module for other pages. Relative addresses: the folder works wherever
// it is put. The wasm stays a file of its own, so that it can be compiled while it arrives.
export default defineConfig({
  base: "./",
  build: {
    target: "es2022",
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    rollupOptions: {
      input: { page: "index.html", "strivec-viewer": "src/index.ts" },
      preserveEntrySignatures: "strict",
      output: {
        entryFileNames: (chunk) => (chunk.name === "strivec-viewer" ? "[name].js" : "assets/[name]-[hash].js"),
      },
    },
  },
});
