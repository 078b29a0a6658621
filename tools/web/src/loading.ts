// Loading of byte ranges from an address, in the order of a download.

import type { Download } from "./generated/strivec";

/** Number of bytes that have arrived, and length of the file once it is known. */
export type Progress = (done: number, all: number | undefined) => void;

/**
 * Loads the ranges that `download` needs from `url`. A server without support for ranges sends the whole file at once.
 */
export async function load(url: string, download: Download, progress: Progress, signal: AbortSignal): Promise<void> {
  for (;;) {
    const wanted = download.wanted();
    if (wanted.length === 0) return;
    for (let n = 0; n < wanted.length; n += 2) {
      const [start, end] = [wanted[n] ?? 0, wanted[n + 1] ?? 0];
      const [before = 0, known] = download.progress;
      const { bytes, isWhole } = await range(url, start, end, signal, (done, all) => {
        progress(all === undefined ? before + done : done, all ?? known);
      });
      if (isWhole) {
        download.add_whole(bytes);
        return;
      }
      download.add(start, end, bytes);
    }
  }
}

interface Piece {
  bytes: Uint8Array;
  /** True if this is the whole file instead of the requested range. */
  isWhole: boolean;
}

async function range(url: string, start: number, end: number, signal: AbortSignal, progress: Progress): Promise<Piece> {
  let response: Response;
  try {
    response = await fetch(url, { headers: { range: `bytes=${start}-${end - 1}` }, signal });
  } catch (error) {
    if (signal.aborted) throw error;
    throw new Error(`${url} cannot be loaded: there is no such server, or it does not allow this page to read from it.`);
  }
  if (!response.ok) throw new Error(`${url} cannot be loaded: ${response.status} ${response.statusText}`);
  const isWhole = response.status !== 206;
  const all = isWhole ? Number(response.headers.get("content-length") ?? 0) || undefined : undefined;
  return { bytes: await body(response, (done) => progress(done, all)), isWhole };
}

async function body(response: Response, progress: (done: number) => void): Promise<Uint8Array> {
  if (!response.body) return new Uint8Array(await response.arrayBuffer());
  const parts: Uint8Array[] = [];
  let done = 0;
  const reader = response.body.getReader();
  for (;;) {
    const { done: ended, value } = await reader.read();
    if (ended) break;
    parts.push(value);
    done += value.length;
    progress(done);
  }
  const bytes = new Uint8Array(done);
  let at = 0;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}
