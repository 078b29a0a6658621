// A server of one folder and some files, for this machine alone. It supports ranges, and records the requests.

import { createReadStream, existsSync, statSync } from "node:fs";
import { createServer } from "node:http";
import { basename, extname, join, normalize } from "node:path";

const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm" };

/**
 * Serves `folder`, `files` by their names, and `pages`, an object of texts by name. Returns the address, the requests (an
 * array of `{ path, range, at }`), a function `hold(path, isHeld)` that delays each range of `path` whose beginning `isHeld`
 * until the function that it returns is called, and a function that stops the server. `hasRanges` turns ranges on.
 */
export async function serve(folder, files, { pages = {}, hasRanges = true } = {}) {
  const named = new Map(files.map((file) => [`/${basename(file)}`, file]));
  const requests = [];
  const held = new Map();
  const server = createServer(async (request, response) => {
    const path = normalize(new URL(request.url, "http://localhost").pathname);
    // Any page may use what is here.
    response.setHeader("access-control-allow-origin", "*");
    const page = pages[path.slice(1)];
    if (page !== undefined) {
      response.writeHead(200, { "content-type": "text/html" }).end(page);
      return;
    }
    const file = named.get(path) ?? join(folder, path === "/" ? "index.html" : path);
    if (!existsSync(file) || !statSync(file).isFile()) {
      response.writeHead(404).end();
      return;
    }
    const { size } = statSync(file);
    const asked = /^bytes=(\d+)-(\d+)$/.exec(request.headers.range ?? "")?.slice(1).map(Number);
    requests.push({ path, range: asked, at: performance.now() });
    const type = { "content-type": TYPES[extname(file)] ?? "application/octet-stream" };
    if (!asked || !hasRanges) {
      response.writeHead(200, { ...type, "content-length": size });
      createReadStream(file).pipe(response);
      return;
    }
    const [start, end] = [asked[0], Math.min(asked[1], size - 1)];
    const holding = held.get(path);
    if (holding?.isHeld(start)) await holding.released;
    if (start >= size) {
      response.writeHead(416).end();
      return;
    }
    response.writeHead(206, {
      ...type,
      "content-length": end - start + 1,
      "content-range": `bytes ${start}-${end}/${size}`,
    });
    createReadStream(file, { start, end }).pipe(response);
  });
  await new Promise((listening) => server.listen(0, "127.0.0.1", listening));
  return {
    address: `http://127.0.0.1:${server.address().port}`,
    requests,
    hold(path, isHeld) {
      let release;
      held.set(path, { isHeld, released: new Promise((resolve) => (release = resolve)) });
      return () => {
        held.delete(path);
        release();
      };
    },
    close: () => new Promise((closed) => server.close(closed) && server.closeAllConnections()),
  };
}
