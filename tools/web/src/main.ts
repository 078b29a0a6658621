// The page: opens the file that its address names, and shows a picture of it.
//
//   ?url=ADDRESS       the .strivec file; elsewhere than here, its server must allow it (CORS)
//   &size=WxH          of the picture
//   &pose=16,NUMBERS   a row-major camera-to-world matrix in the dataset's space, as in transforms_test.json
//   &degrees=N         what the picture spans from left to right
//
// What became of it is in <body data-state>, loading, done or failed; where the picture is from in <body data-pose>.

import { read } from "./fetching";
import { parametersOf } from "./parameters";
import initialize, { Viewer } from "./generated/strivec";

const NO_WEBGPU =
  "This browser has no WebGPU, which the picture is computed with.\n" +
  "Chrome and Edge from 113, Safari from 26 and Firefox from 141 have it on most systems, on https: pages and on localhost.";

function element<T extends HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (!found) throw new Error(`the page has no element ${id}`);
  return found as T;
}

const message = element<HTMLParagraphElement>("message");

function say(state: "loading" | "done" | "failed", text: string): void {
  document.body.dataset.state = state;
  message.textContent = text;
  message.hidden = text === "";
}

/** Shows bytes of red, green, blue and opacity. */
function show(pixels: Uint8ClampedArray<ArrayBuffer>, width: number, height: number): void {
  const canvas = element<HTMLCanvasElement>("picture");
  canvas.width = width;
  canvas.height = height;
  canvas.hidden = false;
  const context = canvas.getContext("2d");
  if (!context) throw new Error("the canvas has no 2D context");
  context.putImageData(new ImageData(pixels, width, height), 0, 0);
}

async function main(): Promise<void> {
  say("loading", "Loading…");
  const { url, width, height, pose, degrees } = parametersOf(new URLSearchParams(location.search));
  if (!("gpu" in navigator)) throw new Error(NO_WEBGPU);

  const [bytes] = await Promise.all([
    read(url, (done, all) => say("loading", `Loading ${(done / 1e6).toFixed(1)} of ${(all / 1e6).toFixed(1)} MB…`)),
    initialize(),
  ]);
  say("loading", "Preparing…");
  const viewer = await Viewer.open(bytes);
  say("loading", "Rendering…");
  const start = performance.now();
  const from = pose ?? viewer.first_pose;
  const pixels = await viewer.render(width, height, from, degrees);
  const seconds = (performance.now() - start) / 1000;
  show(pixels as Uint8ClampedArray<ArrayBuffer>, width, height);

  const facts = JSON.parse(viewer.facts);
  const tensors = facts.scene.scales.reduce((sum: number, scale: { tensors: number }) => sum + scale.tensors, 0);
  element("facts").textContent =
    `${tensors.toLocaleString()} tensors in ${facts.scene.scales.length} scales, ${(facts.scene.bytes / 1e6).toFixed(2)} MB; ` +
    `${seconds.toFixed(2)} s on ${facts.device.name || "this device"}`;
  document.body.dataset.pose = from.join();
  say("done", "");
}

function fail(error: unknown): void {
  console.error(error);
  say("failed", error instanceof Error ? error.message : String(error));
}

// A panic in the library ends no promise; it only surfaces here, and what it was about is on the console.
addEventListener("error", (event) => {
  const died = event.error instanceof WebAssembly.RuntimeError;
  fail(died ? new Error("The viewer has crashed. This browser's console says why.", { cause: event.error }) : event.error);
});
main().catch(fail);
