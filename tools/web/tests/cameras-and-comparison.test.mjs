// Paths, training cameras with their photographs, and two scenes at once, in Chromium.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { basename, join } from "node:path";
import { after, before, test } from "node:test";

import { dist, fixture, launch, levels, out, strivec, visit } from "./browser.mjs";
import { decodedOn, difference } from "./pictures.mjs";
import { serve } from "./server.mjs";

const SIZE = 32;
const POSE = [0.6, -0.48, 0.64, 2.56, 0.8, 0.36, -0.48, -1.92, 0, 0.8, 0.6, 2.4, 0, 0, 0, 1];

let browser, server, context;

before(async () => {
  server = await serve(dist, ["zstd", "residual"].map(fixture));
  browser = await launch();
  context = await browser.newContext({ viewport: { width: 480, height: 320 } });
});

after(async () => {
  await browser?.close();
  await server?.close();
});

async function opened(query, size = SIZE, at = server) {
  const viewer = await visit(context, `${at.address}/?${new URLSearchParams(query)}`, size);
  await viewer.rest(`${query.url} opens`);
  // The frame of a focused canvas, and the elements over it, are not part of the picture.
  await viewer.call((v) => {
    v.shadowRoot.querySelector("canvas").style.outline = "none";
    v.shadowRoot.getElementById("divider").style.opacity = "0";
  });
  return viewer;
}

const seen = async ({ canvas }) => decodedOn(context, await canvas.screenshot());

/** Drops a file of this name and content, a text or bytes. */
const drop = (viewer, name, content, ctrlKey = false) =>
  viewer.call(
    (v, { name, content, ctrlKey }) => {
      const transfer = new DataTransfer();
      transfer.items.add(new File([typeof content === "string" ? content : new Uint8Array(content)], name));
      v.dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, ctrlKey, bubbles: true, cancelable: true }));
    },
    { name, content, ctrlKey },
  );

/** Drops a folder of this machine, as a person would. */
async function dropFolder({ page, canvas }, folder) {
  const { x, y } = await canvas.boundingBox();
  const session = await context.newCDPSession(page);
  for (const type of ["dragEnter", "dragOver", "drop"]) {
    const drag = { type, x: x + 9, y: y + 9, data: { items: [], files: [folder], dragOperationsMask: 1 } };
    await session.send("Input.dispatchDragEvent", drag);
  }
  await session.detach();
}

/** How far two cameras are apart, in any of their numbers. */
const apart = (a, b) => Math.max(...b.map((value, n) => Math.abs(value - a[n])));

test("a path is recorded, kept and played", async () => {
  const viewer = await opened({ url: "zstd.strivec", camera: POSE.join() });
  const { keyboard } = viewer.page;
  const camera = () => viewer.call((v) => v.camera);
  const first = await camera();
  await viewer.canvas.focus();
  await keyboard.press("c");
  assert.equal(await viewer.call((v) => v.state.is_recording), true);
  await viewer.page.waitForTimeout(400);
  await keyboard.press("ArrowRight");
  await keyboard.press("ArrowUp");
  const last = await camera();
  await viewer.rest();
  await viewer.page.waitForTimeout(600);
  const download = viewer.page.waitForEvent("download");
  await keyboard.press("c");
  const file = await download;
  assert.equal(file.suggestedFilename(), "zstd-path.json");
  const path = join(out, "path.json");
  await file.saveAs(path);
  const text = readFileSync(path, "utf8");
  const { keyframes } = JSON.parse(text);
  assert.ok(keyframes.length >= 3, text);
  assert.ok(apart(keyframes[0].transform_matrix.flat(), first.slice(0, 16)) < 1e-6, text);
  assert.ok(apart(keyframes.at(-1).transform_matrix.flat(), last.slice(0, 16)) < 1e-6, text);
  assert.ok(apart(first, last) > 0.05);
  // The command takes it.
  const options = ["--frames", "1", "--size", "8x8", "--out", join(out, "path"), "--force", "--quiet"];
  execFileSync(strivec, ["render", fixture("zstd"), "--path", path, ...options], { stdio: ["ignore", "ignore", "inherit"] });

  await keyboard.press("r");
  assert.ok(apart(await camera(), last) > 1e-3);
  const start = performance.now();
  await keyboard.press(" ");
  await viewer.until("the path begins", (v) => v.state.is_playing);
  await viewer.until("the path ends", (v) => !v.state.is_playing);
  const took = (performance.now() - start) / 1000;
  assert.ok(took > 0.9 * (keyframes.at(-1).seconds - keyframes[0].seconds), `${took} s`);
  assert.ok(apart(await camera(), last) < 1e-6);

  // From a file, and stopped before its end.
  for (const keyframe of keyframes) keyframe.seconds *= 1000;
  await drop(viewer, "slow.json", JSON.stringify({ ...JSON.parse(text), keyframes }));
  await viewer.until("it is played", (v) => v.state.is_playing);
  assert.ok(apart(await camera(), first) < 0.05);
  await viewer.canvas.focus();
  await keyboard.press(" ");
  assert.equal(await viewer.call((v) => v.state.is_playing), false);
  await drop(viewer, "broken.json", "{}");
  await viewer.until("no path", (v) => v.shadowRoot.querySelector("#message.failed") !== null);
  assert.match(await viewer.message(), /broken.json: not the JSON of a camera path/);
  await viewer.page.close();
});

test("training cameras can be chosen, and their photographs blended in", async () => {
  const { file, data } = levels();
  const own = await serve(dist, [file]);
  const photographs = await serve(data, []);
  const { frames } = JSON.parse(readFileSync(join(data, "transforms_train.json"), "utf8"));
  const pose = (n) => frames[n].transform_matrix.flat();
  const photograph = (n) => readFileSync(join(data, `${frames[n].file_path}.png`));
  try {
    const address = `${photographs.address}/transforms_train.json`;
    const viewer = await opened({ url: basename(file), data: address }, 48, own);
    const { keyboard } = viewer.page;
    const camera = () => viewer.call((v) => v.camera);
    await viewer.canvas.focus();
    const last = frames.length - 1;
    const way = [
      ["PageDown", 0],
      ["PageUp", last],
      ["PageDown", 0],
      ["PageDown", 1],
    ];
    for (const [key, number] of way) {
      await keyboard.press(key);
      assert.equal(await viewer.call((v) => v.trainingCamera), number, key);
      assert.ok(apart(await camera(), pose(number)) < 1e-4, `${key}: ${await camera()}`);
    }
    await viewer.rest();
    assert.equal(photographs.requests.length, 1, "only displayed photographs are requested");

    await viewer.call((v) => (v.photographShare = 1));
    await viewer.until("the photograph is there", (v) => v.state.has_photograph);
    await viewer.rest();
    const shows = async (n) => {
      const expected = await whiteOn(context, photograph(n));
      const { mean } = difference(await seen(viewer), expected);
      assert.ok(mean < 2, `photograph ${n}: ${mean}`);
    };
    await viewer.page.waitForTimeout(100);
    await shows(1);
    await keyboard.press("PageDown");
    await viewer.until("the next photograph is there", (v) => v.state.camera === 2 && v.state.has_photograph);
    await viewer.rest();
    await viewer.page.waitForTimeout(100);
    await shows(2);
    assert.equal(photographs.requests.length, 3);

    // The folder, dropped and then chosen; half of each is seen.
    await viewer.call((v) => (v.photographShare = 0));
    await viewer.rest();
    const rendered = await seen(viewer);
    const given = async (give) => {
      await viewer.call((v) => {
        v.photographs = async (from) => (window.isTaken = await Object.getPrototypeOf(v).photographs.call(v, from));
        window.isTaken = undefined;
      });
      await give();
      await viewer.until("the folder is taken", () => window.isTaken);
    };
    await given(() => dropFolder(viewer, data));
    await keyboard.press("PageDown");
    await viewer.call((v) => (v.photographShare = 0.5));
    await viewer.until("a photograph of the folder is there", (v) => v.state.camera === 3 && v.state.has_photograph);
    await given(() => viewer.page.locator("input[webkitdirectory]").setInputFiles(data));
    await keyboard.press("PageUp");
    await viewer.until("and another", (v) => v.state.camera === 2 && v.state.has_photograph);
    await viewer.rest();
    await viewer.page.waitForTimeout(100);
    const half = (await whiteOn(context, photograph(2))).map((v, n) => (v + rendered[n]) / 2);
    const { mean } = difference(await seen(viewer), half);
    assert.ok(mean < 2, `half of each: ${mean}`);
    assert.equal(photographs.requests.length, 3, "they are read, not fetched");

    // Another scene's dataset.
    const rows = [0, 4, 8, 12].map((at) => POSE.slice(at, at + 4));
    const other = JSON.stringify({ frames: [{ file_path: "a", transform_matrix: rows }] });
    await viewer.call((v, text) => v.photographs([new File([text], "transforms_train.json")]), other);
    await keyboard.press("PageDown");
    await viewer.until("it is not this scene's", (v) => v.shadowRoot.querySelector("#message.failed") !== null);
    assert.match(await viewer.message(), /choose the scene's own dataset/);
    assert.equal(await viewer.call((v) => v.photographShare), 0);
    assert.equal(await viewer.call((v) => v.photographs("nowhere.json")), false);
    assert.match(await viewer.message(), /nowhere.json cannot be read/);
    const bent = JSON.stringify({ k1: 0.1, frames: [{ file_path: "a", transform_matrix: rows }] });
    const accepted = await viewer.call((v, text) => v.photographs([new File([text], "transforms.json")]), bent);
    assert.equal(accepted, false);
    assert.match(await viewer.message(), /transforms.json: the photographs have a lens/);
    for (const file_path of ["//host/a.png", "\\\\host\\a.png"]) {
      const elsewhere = JSON.stringify({ frames: [{ file_path, transform_matrix: rows }] });
      const taken = await viewer.call((v, text) => v.photographs([new File([text], "transforms.json")]), elsewhere);
      assert.equal(taken, false);
      assert.match(await viewer.message(), /frame 0: file_path must be relative; found \/\/host\/a.png/);
    }
    await viewer.page.close();
  } finally {
    await own.close();
    await photographs.close();
  }
});

/** A PNG file's pixels, on white. */
async function whiteOn(context, png) {
  const pixels = await decodedOn(context, png);
  return pixels.map((value, at) => {
    const opacity = pixels[at - (at % 4) + 3] / 255;
    return at % 4 === 3 ? 255 : value * opacity + 255 * (1 - opacity);
  });
}

test("two scenes share the canvas", async () => {
  const pictures = [];
  for (const url of ["zstd.strivec", "residual.strivec"]) {
    const alone = await opened({ url, camera: POSE.join() });
    pictures.push(await seen(alone));
    await alone.page.close();
  }
  const [first, second] = pictures;
  assert.ok(difference(first, second).mean > 1, "the scenes look alike");
  /** The first left of column `x`, the second right of it. */
  const divided = (x) => first.map((value, at) => ((at / 4) % SIZE < x ? value : second[at]));

  const query = { url: "zstd.strivec", compare: "residual.strivec", camera: POSE.join() };
  const viewer = await opened(query);
  await viewer.until("both are there", (v) => v.state.second !== null && v.state.is_at_rest);
  assert.equal(await viewer.call((v) => v.name), "zstd.strivec");
  const shown = async (what) => {
    await viewer.rest(what);
    await viewer.page.waitForTimeout(100);
    return seen(viewer);
  };
  const near = async (x, what) => {
    const { mean } = difference(await shown(what), divided(x));
    assert.ok(mean < 0.5, `${what}: ${mean}`);
  };
  await near(SIZE / 2, "in the middle");
  const divider = viewer.page.getByRole("slider", { name: /divider/i });
  await divider.focus();
  await viewer.page.keyboard.press("Home");
  await near(0, "all of the second");
  await viewer.page.keyboard.press("End");
  await near(SIZE, "all of the first");
  assert.equal(await divider.getAttribute("aria-valuenow"), "100");
  const box = await viewer.canvas.boundingBox();
  await viewer.page.mouse.move(box.x + SIZE - 1, box.y + 9);
  await viewer.page.mouse.down();
  await viewer.page.mouse.move(box.x + SIZE / 4, box.y + 9);
  await viewer.page.mouse.up();
  await near(SIZE / 4, "dragged");

  const screenshot = await viewer.call(async (v) => {
    const bytes = new Uint8Array(await (await v.screenshot()).arrayBuffer());
    return btoa(String.fromCharCode(...bytes));
  });
  const taken = await decodedOn(context, Buffer.from(screenshot, "base64"));
  assert.ok(difference(taken, divided(SIZE / 4)).mean < 0.5, "the screenshot shows both");

  // Side by side, each picture is as wide as its half.
  await viewer.call((v) => (v.divider = undefined));
  assert.equal(await viewer.call((v) => v.state.divider), null);
  const sides = await shown("side by side");
  writeFileSync(join(out, "side-by-side.png"), await viewer.canvas.screenshot());
  const half = (picture, from) =>
    picture.filter((_, at) => (at / 4) % SIZE >= from && (at / 4) % SIZE < from + SIZE / 2);
  assert.ok(difference(half(sides, 0), half(sides, SIZE / 2)).mean > 1, "both halves show the same");
  assert.ok(difference(half(sides, 0), half(first, SIZE / 4)).mean < 1, "the first is not in the left half");
  assert.ok(difference(half(sides, SIZE / 2), half(second, SIZE / 4)).mean < 1, "the second is not in the right half");
  assert.equal(await divider.count(), 0);
  const before = await viewer.call((v) => v.camera);
  await viewer.canvas.press("ArrowLeft");
  assert.notDeepEqual(await viewer.call((v) => v.camera), before, "the camera of both moves");
  await viewer.call((v, camera) => (v.camera = camera), before);

  assert.equal(await viewer.call((v) => v.compare("none.strivec")), false);
  assert.match(await viewer.message(), /none.strivec cannot be loaded: 404/);
  await viewer.call((v) => v.removeAttribute("compare"));
  assert.equal(await viewer.call((v) => v.state.second), null);
  assert.ok(difference(await shown("alone again"), first).mean < 0.5, "the first alone");

  // Dropped with Control, and closed by the panel.
  const bytes = Array.from(readFileSync(fixture("residual")));
  await drop(viewer, "dropped.strivec", bytes, true);
  await viewer.until("both are there again", (v) => v.state.second !== null && v.state.is_at_rest);
  await viewer.call((v) => (v.style.width = "460px") && v.setAttribute("controls", ""));
  await viewer.page.getByRole("checkbox", { name: "side by side" }).uncheck();
  assert.equal(await viewer.call((v) => v.divider), 0.5);
  await viewer.page.getByRole("button", { name: "close" }).press("Enter");
  assert.equal(await viewer.call((v) => v.state.second), null);
  await viewer.page.close();
});
