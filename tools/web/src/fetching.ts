// Bytes from an address, with progress.

/** The bytes at `url`; `progress` hears of what is there of all, where the server says how much that is. */
export async function read(url: string, progress: (done: number, all: number) => void): Promise<Uint8Array> {
  let response: Response;
  try {
    response = await fetch(url);
  } catch {
    throw new Error(`${url} cannot be loaded: there is no such server, or it does not allow this page to read from it.`);
  }
  if (!response.ok) throw new Error(`${url} cannot be loaded: ${response.status} ${response.statusText}`);
  const all = Number(response.headers.get("content-length") ?? 0);
  if (!response.body || all === 0) return new Uint8Array(await response.arrayBuffer());

  const parts: Uint8Array[] = [];
  let done = 0;
  const reader = response.body.getReader();
  for (;;) {
    const { done: ended, value } = await reader.read();
    if (ended) break;
    parts.push(value);
    done += value.length;
    progress(done, Math.max(done, all));
  }
  const bytes = new Uint8Array(done);
  let at = 0;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}
