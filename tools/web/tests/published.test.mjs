// The pages that the Python package writes, and its widget for notebooks, in Chromium.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";

import { fixture, launch, out, python, visit } from "./browser.mjs";
import { decodedOn } from "./pictures.mjs";
import { serve } from "./server.mjs";

const SIZE = 64;
const SCENE = fixture("everything");
const skip = python ? false : "needs the Python package: set STRIVEC_PYTHON";

let browser, context;

before(async () => {
  browser = await launch();
  context = await browser.newContext({ viewport: { width: 480, height: 320 } });
});

after(() => browser?.close());

const inPython = (...words) => execFileSync(python, words, { encoding: "utf-8", maxBuffer: 1 << 28 });

/** The address of the page that the package makes of the scene under the name `name`. */
function published(name) {
  const path = join(out, name);
  inPython("-m", "strivec", "publish", SCENE, path, "--force");
  return path;
}

/** Shows the page at `address`; returns the picture from its first camera. */
async function pictureAt(address) {
  const viewer = await visit(context, address, SIZE);
  await viewer.rest(address);
  const shown = await decodedOn(context, await viewer.canvas.screenshot());
  assert.ok(Math.max(...shown) - Math.min(...shown) > 20, "the picture shows nothing");
  const pixels = await viewer.call(async (v, size) => {
    const pose = v.camera.slice(0, 16);
    return Array.from(await v.render(size, size, pose, 40));
  }, SIZE);
  // Warnings of the shader compiler are none of the page.
  assert.deepEqual(viewer.messages.filter((message) => message.startsWith("error")), []);
  await viewer.page.close();
  return pixels;
}

test("the folder on a server, and the file from disk, show the same scene", { skip }, async () => {
  const server = await serve(published("site"), []);
  const folder = await pictureAt(server.address).finally(() => server.close());
  assert.deepEqual(await pictureAt(pathToFileURL(published("scene.html")).href), folder);
});

test("a notebook's widget shows the scene and tells the camera", { skip }, async () => {
  const module = inPython("-c", `import strivec; print(strivec.Scene.load(${JSON.stringify(SCENE)}).widget()._esm)`);
  // A page that calls the module as anywidget does, with a model like that of Jupyter.
  const host = `
    import widget from ${JSON.stringify(`data:text/javascript;base64,${Buffer.from(module).toString("base64")}`)};
    const bytes = Uint8Array.from(atob("${readFileSync(SCENE).toString("base64")}"), (letter) => letter.charCodeAt(0));
    const values = { data: new DataView(bytes.buffer), height: ${SIZE}, camera: [] };
    const model = { get: (name) => values[name], set: (name, value) => (values[name] = value), save_changes() {}, on() {} };
    await widget.render({ model, el: document.body });
    window.values = values;`;
  const server = await serve(out, [], { pages: { "notebook.html": `<body><script type="module">${host}</script></body>` } });
  const viewer = await visit(context, `${server.address}/notebook.html`);
  await viewer.until("the widget is there", (v) => window.values !== undefined);
  await viewer.rest("the widget");
  assert.equal(await viewer.page.evaluate(() => window.values.camera.length), 17);
  await viewer.page.close();
  await server.close();
});
