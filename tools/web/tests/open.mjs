// Opens files on the built page in Chromium, and compares its pictures with those of the command `strivec render`.
//
//   node tests/open.mjs [FILE …]     default: some of fixtures/v1
//
// Needs dist/ (build.sh), Chromium ($CHROMIUM, default /usr/bin/chromium) and the command ($STRIVEC, default: the one in the
// build folder). Works without a graphics processor: Chromium then computes by SwiftShader, slowly, so pictures are small.
// Leaves its own pictures, the command's and screenshots in $STRIVEC_WEB_OUT, default a new folder in the system's own.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, join, resolve } from "node:path";
import { chromium } from "playwright-core";

import { decodedOn } from "./pictures.mjs";
import { serve } from "./server.mjs";

const web = resolve(import.meta.dirname, "..");
const root = resolve(web, "../..");
const build = process.env.CARGO_TARGET_DIR ?? join(root, "target");
const strivec = process.env.STRIVEC ?? join(build, "release/strivec");
const out = process.env.STRIVEC_WEB_OUT ?? mkdtempSync(join(tmpdir(), "strivec-web-"));
const files = process.argv.slice(2).map((file) => resolve(file));
if (files.length === 0) {
  // Compressed bodies, and every place where the decoder may be called.
  files.push(...["zstd", "per-ray", "residual"].map((name) => join(root, `fixtures/v1/${name}.strivec`)));
}
const chrome = process.env.CHROMIUM ?? "/usr/bin/chromium";
for (const [path, what] of [
  [join(web, "dist/index.html"), "run tools/web/build.sh first"],
  [strivec, "build it (cargo build --release), or set STRIVEC"],
  [chrome, "apt-get install chromium, or set CHROMIUM"],
]) {
  if (!existsSync(path)) throw new Error(`${path} is missing: ${what}`);
}

// What gives a software adapter, right compute and a right canvas in headless Chromium without a graphics processor.
const flags = [
  "--no-sandbox",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
  "--no-first-run",
  "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader",
  "--enable-unsafe-webgpu",
  "--ignore-gpu-blocklist",
  "--enable-gpu",
  "--enable-features=Vulkan",
  "--use-vulkan=swiftshader",
];
const SIZE = 64;
const DEGREES = 40;

/** Opens the page with `parameters`; what became of it. */
async function opened(context, address, parameters, name) {
  const page = await context.newPage();
  const messages = [];
  page.on("console", (message) => messages.push(`${message.type()}: ${message.text()}`));
  page.on("pageerror", (error) => messages.push(`error: ${error}`));
  await page.goto(`${address}/?${new URLSearchParams(parameters)}`);
  await page.waitForFunction(() => ["done", "failed"].includes(document.body.dataset.state), undefined, {
    timeout: 300_000,
  });
  await page.screenshot({ path: join(out, `${name}-page.png`) });
  const found = await page.evaluate(() => {
    const canvas = document.getElementById("picture");
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    return {
      state: document.body.dataset.state,
      message: document.getElementById("message").textContent,
      facts: document.getElementById("facts").textContent,
      pose: document.body.dataset.pose,
      size: [canvas.width, canvas.height],
      pixels: Array.from(data),
      png: canvas.toDataURL("image/png").split(",")[1],
    };
  });
  await page.close();
  return { ...found, messages };
}

/** Largest and mean difference of a channel, and the share of pixels that differ by more than two of 255. */
function difference(pixels, reference) {
  assert.equal(pixels.length, reference.length, "pictures differ in size");
  let [largest, sum, far] = [0, 0, 0];
  for (let at = 0; at < pixels.length; at += 4) {
    const channels = [0, 1, 2].map((c) => Math.abs(pixels[at + c] - reference[at + c]));
    largest = Math.max(largest, ...channels);
    sum += channels[0] + channels[1] + channels[2];
    far += Math.max(...channels) > 2 ? 1 : 0;
  }
  return { largest, mean: sum / (pixels.length * 0.75), far: far / (pixels.length / 4) };
}

/** Few pixels may differ: samples that lie next to a threshold fall on its other side. */
function agrees({ mean, far }) {
  return mean < 0.25 && far < 0.01;
}

const server = await serve(join(web, "dist"), files);
const browser = await chromium.launch({ executablePath: chrome, args: flags });
try {
  const context = await browser.newContext({ viewport: { width: 480, height: 320 } });
  for (const file of files) {
    const name = basename(file, ".strivec");
    const size = `${SIZE}x${SIZE}`;
    const found = await opened(context, server.address, { url: basename(file), size, degrees: DEGREES }, name);
    assert.equal(found.state, "done", `${name}: ${found.message}\n${found.messages.join("\n")}`);
    assert.deepEqual(found.size, [SIZE, SIZE]);
    writeFileSync(join(out, `${name}-web.png`), Buffer.from(found.png, "base64"));

    const folder = join(out, name);
    const pose = `--pose=${found.pose}`;
    const options = ["--size", size, "--fov", String(DEGREES), "--out", folder, "--force", "--quiet"];
    execFileSync(strivec, ["render", file, pose, ...options], { stdio: ["ignore", "ignore", "inherit"] });
    const reference = await decodedOn(context, readFileSync(join(folder, "pose.png")));
    const compared = difference(found.pixels, reference);
    console.log(`${name}: ${found.facts}; ${JSON.stringify(compared)}`);
    assert.ok(agrees(compared), `${name}: the page's picture is not the command's: ${JSON.stringify(compared)}`);
    const colors = new Set(reference.filter((_, at) => at % 4 === 1));
    assert.ok(colors.size > 8, `${name}: a picture of ${colors.size} greens says nothing`);
    const shifted = reference.slice(4).concat(reference.slice(0, 4));
    assert.ok(!agrees(difference(found.pixels, shifted)), `${name}: a picture moved by a pixel goes unnoticed`);
  }

  const failures = [
    ["none.strivec", "none.strivec cannot be loaded: 404"],
    ["index.html", "strivec"],
  ];
  for (const [url, expected] of failures) {
    const found = await opened(context, server.address, { url }, `failed-${url}`);
    assert.equal(found.state, "failed", url);
    assert.ok(found.message.includes(expected), `${url}: ${found.message}`);
    console.log(`${url}: ${found.message}`);
  }

  const lacking = [
    ["without-webgpu", () => delete Navigator.prototype.gpu, /no WebGPU/],
    ["without-adapter", () => (GPU.prototype.requestAdapter = async () => null), /no graphics adapter was found/],
  ];
  for (const [name, change, expected] of lacking) {
    const without = await browser.newContext();
    await without.addInitScript(change);
    const found = await opened(without, server.address, { url: basename(files[0]) }, name);
    assert.equal(found.state, "failed");
    assert.match(found.message, expected);
    console.log(`${name}: ${found.message}`);
  }
} finally {
  await browser.close();
  await server.close();
}
console.log(`The page shows what the command does. Pictures: ${out}`);
