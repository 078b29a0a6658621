// What the page's address asks for.

export interface Parameters {
  url: string;
  width: number;
  height: number;
  /** Row-major, camera to world; the file's own first one where there is none. */
  pose: Float64Array | undefined;
  degrees: number;
}

/** Throws where the address names no file, or asks for what makes no sense. */
export function parametersOf(search: URLSearchParams): Parameters {
  const url = search.get("url");
  if (!url) throw new Error("Which file? Add ?url=scene.strivec to this page's address.");
  const size = search.get("size") ?? "512x512";
  const [, width, height] = /^(\d{1,5})x(\d{1,5})$/.exec(size)?.map(Number) ?? [];
  if (!width || !height) throw new Error(`size: expected WxH, found ${size}`);
  const pose = search.get("pose")?.split(",").map(Number);
  const degrees = Number(search.get("degrees") ?? 40);
  return { url, width, height, pose: pose && new Float64Array(pose), degrees };
}
