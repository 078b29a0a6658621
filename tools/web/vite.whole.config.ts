import { defineConfig } from "vite";

// The custom element as one module, the wasm in it: for pages that are one file, and for notebooks.
export default defineConfig({
  build: {
    target: "es2022",
    emptyOutDir: false,
    lib: { entry: "src/index.ts", formats: ["es"], fileName: () => "strivec-viewer-whole.js" },
  },
});
