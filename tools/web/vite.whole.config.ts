import { defineConfig } from "vite";

// The custom element with its wasm in one file, which needs no server: for pages that hold a scene, and for notebooks.
export default defineConfig({
  build: {
    target: "es2022",
    emptyOutDir: false,
    lib: { entry: "src/index.ts", formats: ["es"], fileName: () => "strivec-viewer-whole.js" },
  },
});
