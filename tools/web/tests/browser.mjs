// Chromium with WebGPU, and what the tests need besides.
//
// Needs dist/ (build.sh), Chromium ($CHROMIUM, default /usr/bin/chromium) and the commands ($STRIVEC, default: the one in the
// build folder, and strivec-pack beside it). Works without a graphics processor: Chromium then computes by SwiftShader, slowly, so pictures are small.
// $STRIVEC_PYTHON is a Python that has the package of tools/python, whose pages are tested too.
// Leaves pictures in $STRIVEC_WEB_OUT, default a new folder in the system's own.

import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { chromium } from "playwright-core";

const web = resolve(import.meta.dirname, "..");
export const root = resolve(web, "../..");
export const dist = join(web, "dist");
const build = resolve(root, process.env.CARGO_TARGET_DIR ?? "target");
export const strivec = process.env.STRIVEC ?? join(build, "release/strivec");
export const python = process.env.STRIVEC_PYTHON;
const pack = process.env.STRIVEC_PACK ?? join(strivec, "../strivec-pack");
export const out = resolve(process.env.STRIVEC_WEB_OUT ?? mkdtempSync(join(tmpdir(), "strivec-web-")));
mkdirSync(out, { recursive: true });
const chrome = process.env.CHROMIUM ?? "/usr/bin/chromium";
for (const [path, what] of [
  [join(dist, "index.html"), "run tools/web/build.sh first"],
  [strivec, "build it (cargo build --release), or set STRIVEC"],
  [chrome, "apt-get install chromium, or set CHROMIUM"],
]) {
  if (!existsSync(path)) throw new Error(`${path} is missing: ${what}`);
}

/** One of the format's fixtures. */
export const fixture = (name) => join(root, `fixtures/v1/${name}.strivec`);

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

export const launch = () => chromium.launch({ executablePath: chrome, args: flags });

let made;

/**
 * A scene that is trained here in some seconds: `file`, of two scales, large enough to be loaded in pieces, with its training
 * cameras, and `data`, the dataset's folder.
 */
export function levels() {
  if (made) return made;
  if (!existsSync(pack)) throw new Error(`${pack} is missing: build it (cargo build --release), or set STRIVEC_PACK`);
  const run = (program, ...options) =>
    execFileSync(program, [...options, "--quiet", "--force"], { cwd: out, stdio: ["ignore", "ignore", "inherit"] });
  const [data, trained, file] = ["photographs", "trained.strivec", "levels.strivec"].map((name) => join(out, name));
  const config = join(import.meta.dirname, "levels.toml");
  run(strivec, "synth", data, "--views", "12", "--test-views", "2", "--size", "48x48");
  // All parameters, as 32-bit numbers, make the file larger than those that are shown in one step.
  const training = ["--config", config, "--prior", join(data, "mesh.ply"), "--set", "lean.max_loss=0", "--keep-dead", "--encoding", "f32"];
  run(strivec, "train", data, "-o", trained, ...training);
  const options = ["--lossless", "--level", "0", "--effort", "0.1", "--data", data, "--with-cameras"];
  run(pack, "pack", trained, "-o", file, ...options);
  return (made = { file, data });
}

/** Opens `address` with a viewer that is `size` pixels large; collects what the console says. */
export async function visit(context, address, size) {
  const page = await context.newPage();
  const messages = [];
  page.on("console", (message) => messages.push(`${message.type()}: ${message.text()}`));
  page.on("pageerror", (error) => messages.push(`error: ${error}`));
  // Before anything runs, so that the first picture is small already.
  if (size) {
    await page.addInitScript((size) => {
      addEventListener("DOMContentLoaded", () => {
        const viewer = document.querySelector("strivec-viewer");
        viewer?.removeAttribute("controls");
        if (viewer) viewer.style.cssText = `width: ${size}px; height: ${size}px; min-height: 0`;
      });
    }, size);
  }
  await page.goto(address);
  const viewer = page.locator("strivec-viewer");
  const call = (work, argument) => viewer.evaluate(work, argument, { timeout: 600_000 });
  // No function is made of text in the page: the policy of a published page forbids that.
  const until = async (what, condition, argument) => {
    try {
      const end = Date.now() + 600_000;
      while (!(await call(condition, argument))) {
        if (Date.now() > end) throw new Error("not within 10 minutes");
        await new Promise((resolve) => setTimeout(resolve, 50));
      }
    } catch (error) {
      const message = await viewer.evaluate((v) => v.shadowRoot.getElementById("message").textContent).catch(() => "");
      throw new Error(`${what}: ${error.message}\nmessage: ${message}\n${messages.join("\n")}`);
    }
  };
  return {
    page,
    messages,
    call,
    until,
    /** Until the whole picture is on the canvas. */
    rest: (what = "a whole picture") => until(what, (v) => v.state?.is_at_rest === true),
    message: () => call((v) => v.shadowRoot.getElementById("message").textContent),
    canvas: viewer.locator("canvas"),
  };
}
