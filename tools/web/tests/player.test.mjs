// The page in Chromium, as people use it.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { basename, join } from "node:path";
import { after, before, test } from "node:test";

import { dist, fixture, launch, levels, out, root, strivec, visit } from "./browser.mjs";
import { decodedOn, difference } from "./pictures.mjs";
import { serve } from "./server.mjs";

const SIZE = 64;
const DEGREES = 40;
const POSE = [0.6, -0.48, 0.64, 2.56, 0.8, 0.36, -0.48, -1.92, 0, 0.8, 0.6, 2.4, 0, 0, 0, 1];

let browser, server, context;

before(async () => {
  const files = ["zstd", "per-ray", "residual", "everything"].map(fixture);
  server = await serve(dist, [...files, join(root, "README.md")]);
  browser = await launch();
  context = await browser.newContext({ viewport: { width: 480, height: 320 } });
});

after(async () => {
  await browser?.close();
  await server?.close();
});

/** Opens a file on the page, and waits for its whole picture. */
async function opened(name, more = {}) {
  const query = new URLSearchParams({ url: name, camera: POSE.join(), ...more });
  const viewer = await visit(context, `${server.address}/?${query}`, SIZE);
  await viewer.rest(`${name} opens`);
  return viewer;
}

/** What is on the canvas. */
async function seen({ canvas }) {
  return decodedOn(context, await canvas.screenshot());
}

async function picturesOf(viewer, change, what) {
  const before = await seen(viewer);
  const frames = await viewer.call((v) => Number(v.dataset.frames));
  await change();
  await viewer.until(what, (v, frames) => Number(v.dataset.frames) > frames, frames);
  await viewer.rest(what);
  return difference(await seen(viewer), before);
}

for (const name of ["zstd", "per-ray", "residual"]) {
  test(`${name}: the picture is the command's`, async () => {
    const viewer = await opened(`${name}.strivec`);
    const camera = await viewer.call((v) => v.camera);
    assert.ok(camera.length === 17 && POSE.every((v, n) => Math.abs(v - camera[n]) < 1e-9), `${camera}`);
    const pixels = await viewer.call(
      async (v, { size, pose, degrees }) => Array.from(await v.render(size, size, pose, degrees)),
      { size: SIZE, pose: POSE, degrees: DEGREES },
    );
    const folder = join(out, name);
    const options = ["--size", `${SIZE}x${SIZE}`, "--fov", `${DEGREES}`, "--out", folder, "--force", "--quiet"];
    execFileSync(strivec, ["render", fixture(name), `--pose=${POSE}`, ...options], {
      stdio: ["ignore", "ignore", "inherit"],
    });
    const reference = await decodedOn(context, readFileSync(join(folder, "pose.png")));
    const { mean, far } = difference(pixels, reference);
    // Few pixels may differ: samples that lie next to a threshold fall on its other side.
    assert.ok(mean < 0.25 && far < 0.01, `mean ${mean}, far ${far}`);
    const [least, most] = [Math.min(...reference), Math.max(...reference)];
    assert.ok(most - least > 20, "the picture shows nothing");

    // What is on the canvas is what a screenshot shows.
    const screenshot = await viewer.call(async (v) => {
      const blob = await v.screenshot();
      const bytes = new Uint8Array(await blob.arrayBuffer());
      return btoa(String.fromCharCode(...bytes));
    });
    await viewer.rest();
    const taken = await decodedOn(context, Buffer.from(screenshot, "base64"));
    const shown = difference(await seen(viewer), taken);
    assert.ok(shown.mean < 1, `canvas and screenshot differ: ${JSON.stringify(shown)}`);
    await viewer.page.close();
  });
}

test("pointer, wheel and keys move the camera and change the picture", async () => {
  const viewer = await opened("zstd.strivec");
  const { mouse, keyboard } = viewer.page;
  const camera = () => viewer.call((v) => v.camera);
  const first = await camera();
  const drag = async (button) => {
    await mouse.move(20, 30);
    await mouse.down({ button });
    await mouse.move(30, 36, { steps: 3 });
    await mouse.up({ button });
  };
  const changes = {
    "a drag": () => drag("left"),
    "a drag with the right button": () => drag("right"),
    "the wheel": () => mouse.wheel(0, -240),
    "flying": () => keyboard.press("w", { delay: 200 }),
    "an arrow key": () => keyboard.press("ArrowLeft"),
  };
  for (const [what, change] of Object.entries(changes)) {
    const before = await camera();
    const { mean } = await picturesOf(viewer, change, what);
    assert.notDeepEqual(await camera(), before, what);
    assert.ok(mean > 0.2, `${what}: ${mean}`);
  }
  await picturesOf(viewer, () => keyboard.press("r"), "reset");
  // The first view is the file's own, not the one in the address.
  assert.notDeepEqual(await camera(), first);

  const views = [];
  for (let n = 0; n < 5; n++) {
    const { mean } = await picturesOf(viewer, () => keyboard.press("v"), "the next view");
    views.push(await viewer.call((v) => v.state.view));
    assert.ok(mean > 0.2, `${views.at(-1)}: ${mean}`);
  }
  assert.deepEqual(views, ["depth", "opacity", "normals", "samples", "color"]);
  const boxes = await picturesOf(viewer, () => keyboard.press("b"), "boxes");
  assert.ok(boxes.mean > 0.2);

  const dialog = viewer.page.getByRole("dialog");
  await keyboard.press("h");
  await dialog.waitFor({ state: "visible" });
  await keyboard.press("Escape");
  await dialog.waitFor({ state: "hidden" });
  await keyboard.press("h");
  await dialog.waitFor({ state: "visible" });
  await keyboard.press("h");
  await dialog.waitFor({ state: "hidden" });

  await keyboard.press("f");
  const download = viewer.page.waitForEvent("download");
  await keyboard.press("p");
  assert.equal((await download).suggestedFilename(), "zstd.png");
  await viewer.rest("after the screenshot");
  assert.deepEqual(viewer.messages.filter((m) => m.startsWith("error")), []);
  await viewer.page.close();
});

test("the panel shows facts, and its controls work by keyboard", async () => {
  const viewer = await opened("everything.strivec");
  const { page } = viewer;
  await viewer.canvas.focus();
  await viewer.call((v) => (v.style.width = "460px"));
  await page.keyboard.press("i");
  const panel = page.getByRole("complementary");
  await panel.waitFor({ state: "visible" });
  const facts = await panel.locator("#facts").innerText();
  for (const expected of ["0.01 MB", "tensors\n6", "scale 1", "30 000", "lego"]) {
    assert.ok(facts.includes(expected), `${expected}: ${facts}`);
  }
  await page.getByRole("radio", { name: "depth" }).focus();
  await page.keyboard.press("Space");
  assert.equal(await viewer.call((v) => v.state.view), "depth");
  await page.getByRole("slider", { name: "resolution" }).focus();
  await page.keyboard.press("ArrowRight");
  assert.equal(await viewer.call((v) => v.state.quality.finest), 2);
  await page.getByRole("button", { name: "exact" }).press("Enter");
  assert.equal(await viewer.call((v) => v.state.quality.finest), 1);
  await page.getByRole("checkbox", { name: "tensor boxes" }).check();
  assert.equal(await viewer.call((v) => v.state.has_boxes), true);
  await viewer.rest();
  await page.screenshot({ path: join(out, "panel.png") });
  await page.close();
});

test("errors of opening are shown, and the player keeps working", async () => {
  const viewer = await opened("zstd.strivec");
  for (const [url, expected] of [
    ["none.strivec", /none.strivec cannot be loaded: 404/],
    ["README.md", /not a \.strivec file/],
  ]) {
    assert.equal(await viewer.call((v, url) => v.openUrl(url), url), false);
    assert.match(await viewer.message(), expected);
  }
  // Files of this machine, dropped on the page.
  const bytes = Array.from(readFileSync(fixture("zstd")));
  const drop = (bytes) =>
    viewer.call((v, bytes) => {
      const transfer = new DataTransfer();
      transfer.items.add(new File([new Uint8Array(bytes)], "dropped.strivec"));
      v.dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, bubbles: true, cancelable: true }));
    }, bytes);
  await drop(bytes.map((byte, at) => (at === 20_000 ? byte ^ 1 : byte)));
  await viewer.until("the error is shown", (v) => v.shadowRoot.querySelector("#message.failed") !== null);
  assert.match(await viewer.message(), /\w/);
  assert.equal(await viewer.call((v) => v.name), "zstd.strivec");
  const { mean } = await picturesOf(viewer, () => viewer.canvas.press("ArrowLeft"), "after the error");
  assert.ok(mean > 0.2, `${mean}`);
  await drop(bytes);
  await viewer.until("the whole file opens", (v) => v.name === "dropped.strivec" && v.state.is_at_rest);
  assert.equal(await viewer.message(), "");
  await viewer.page.close();
});

test("the coarse scale of a large file is displayed before the rest is requested", async () => {
  const { file } = levels();
  const size = readFileSync(file).length;
  const path = `/${basename(file)}`;
  const own = await serve(dist, [file]);
  const whole = await serve(dist, [file], { hasRanges: false });
  try {
    // The server holds back everything but the first bytes, the coarse scale behind them, and what lies at the end.
    const FIRST = 16 << 10;
    const asked = () => own.requests.filter((request) => request.path === path);
    const release = own.hold(path, (start) => start > FIRST && start < size - (64 << 10));
    const viewer = await visit(context, `${own.address}/?url=${basename(file)}`, 32);
    await viewer.until("a part is shown", (v) => v.state?.is_at_rest && !v.state.is_whole);
    const { scales, all_scales } = await viewer.call((v) => v.state);
    assert.ok(scales < all_scales, `${scales} of ${all_scales}`);
    const coarse = await seen(viewer);
    assert.ok(Math.max(...coarse) - Math.min(...coarse) > 20, "the part shows nothing");
    assert.deepEqual(asked()[0].range, [0, FIRST - 1]);
    release();
    await viewer.until("all is there", (v) => v.state.is_whole && v.state.is_at_rest);
    const bytes = asked().reduce((sum, { range: [start, end] }) => sum + Math.min(end, size - 1) + 1 - start, 0);
    assert.equal(bytes, size, "no byte is requested twice");
    console.log(`${asked().length} requests: ${asked().map(({ range }) => range.join("-"))} of ${size}`);
    const fine = await seen(viewer);
    writeFileSync(join(out, "streamed.png"), await viewer.canvas.screenshot());
    await viewer.page.close();

    // A server without support for ranges.
    const other = await visit(context, `${whole.address}/?url=${basename(file)}`, 32);
    await other.rest();
    assert.equal(whole.requests.filter((request) => request.path === path).length, 1);
    assert.ok(difference(await seen(other), fine).mean < 0.5, "the picture depends on the way of loading");
    await other.page.close();
  } finally {
    await own.close();
    await whole.close();
  }
});

test("the element works in a foreign page", async () => {
  const text = `<!doctype html><title>foreign</title><style>p { color: red }</style><p>words</p>
    <strivec-viewer src="${server.address}/zstd.strivec" camera="${POSE}" style="width: ${SIZE}px; height: ${SIZE}px; min-height: 0"></strivec-viewer>
    <input aria-label="words" />
    <script type="module" src="${server.address}/strivec-viewer.js"></script>`;
  const foreign = await serve(dist, [], { pages: { "foreign/page.html": text } });
  try {
    const viewer = await visit(context, `${foreign.address}/foreign/page.html`);
    await viewer.rest();
    const picture = await seen(viewer);
    assert.ok(Math.max(...picture) - Math.min(...picture) > 20, "it shows nothing");
    // Keys of the page are the page's.
    const camera = await viewer.call((v) => v.camera);
    await viewer.page.getByRole("textbox").pressSequentially("wasd");
    assert.deepEqual(await viewer.call((v) => v.camera), camera);
    assert.equal(await viewer.page.getByRole("textbox").inputValue(), "wasd");
    await viewer.page.close();
  } finally {
    await foreign.close();
  }
});

for (const [name, change, expected] of [
  ["WebGPU", () => delete Navigator.prototype.gpu, /no WebGPU/],
  ["an adapter", () => (GPU.prototype.requestAdapter = async () => null), /no graphics adapter was found/],
]) {
  test(`without ${name} the page shows an error`, async () => {
    const without = await browser.newContext();
    await without.addInitScript(change);
    const viewer = await visit(without, `${server.address}/?url=zstd.strivec`, SIZE);
    await viewer.until("a message", (v) => v.shadowRoot.querySelector("#message.failed") !== null);
    assert.match(await viewer.message(), expected);
    await without.close();
  });
}
