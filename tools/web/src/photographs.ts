// Photographs of a dataset, each loaded when it is shown. A `transforms` file (NeRF-synthetic's layout) holds the camera of
// each photograph.

/** Names of a dataset's list of training cameras; the first that exists is read. */
const LISTS = ["transforms_train.json", "transforms.json"];
/** Maximum width and height; larger photographs are reduced, as devices support no larger textures. */
const MOST_PIXELS = 4096;
/** Maximum distance between a scene's camera and its photograph's, relative to the distance from the origin. */
const NEAR = 1e-3;

/** Reads the file at `path` of a folder; undefined if it does not exist. */
type Read = (path: string) => Promise<Blob | undefined>;

interface Frame {
  path: string;
  /** Row-major, camera to world. */
  pose: number[];
}

export interface Photograph {
  width: number;
  height: number;
  /** Red, green, blue and opacity of each pixel. */
  bytes: Uint8Array;
}

export class Photographs {
  readonly #read: Read;
  readonly #frames: Frame[];

  private constructor(read: Read, frames: Frame[]) {
    this.#read = read;
    this.#frames = frames;
  }

  /** Photographs that the `transforms` file at `url` lists, relative to `url`; those of a folder if `url` ends with /. */
  static async ofUrl(url: string): Promise<Photographs> {
    const whole = new URL(url, document.baseURI).href;
    const read: Read = async (path) => {
      const escaped = path.split("/").map(encodeURIComponent).join("/");
      const response = await fetch(new URL(escaped, whole)).catch(() => undefined);
      return response?.ok ? response.blob() : undefined;
    };
    return Photographs.#of(read, whole.endsWith("/") ? LISTS : [new URL(whole).pathname.split("/").pop() ?? ""]);
  }

  /** Photographs of a chosen folder, or of dropped files. */
  static async ofFiles(files: Iterable<File>): Promise<Photographs> {
    const named = new Map<string, File>();
    for (const file of files) named.set(file.webkitRelativePath.replace(/^[^/]*\//, "") || file.name, file);
    // Files that are dropped one by one have no folder in their path.
    const read: Read = async (path) => named.get(path) ?? named.get(path.split("/").pop() ?? "");
    const list = [...LISTS, ...[...named.keys()].filter((name) => /^transforms[^/]*\.json$/.test(name))];
    return Photographs.#of(read, list);
  }

  /** Photographs of a dropped folder. */
  static async ofFolder(folder: FileSystemDirectoryEntry): Promise<Photographs> {
    const read: Read = (path) =>
      new Promise((found) => {
        const none = (): void => found(undefined);
        folder.getFile(path, {}, (entry) => (entry as FileSystemFileEntry).file(found, none), none);
      });
    return Photographs.#of(read, LISTS);
  }

  static async #of(read: Read, lists: string[]): Promise<Photographs> {
    for (const name of lists) {
      const list = await read(name);
      if (list) return new Photographs(read, framesOf(name, await list.text()));
    }
    throw new Error(`photographs: ${lists.join(" or ")} cannot be read`);
  }

  /** The photograph from `pose`, a row-major camera-to-world matrix, on `background`, sRGB from 0 to 1. */
  async at(pose: ArrayLike<number>, background: number[]): Promise<Photograph> {
    const frame = this.#frames.find((frame) => isNear(frame.pose, pose));
    if (!frame) throw new Error("photographs: none was taken by this camera; choose the scene's own dataset");
    const file = await this.#read(frame.path);
    if (!file) throw new Error(`photographs: ${frame.path} is missing`);
    return decoded(file, background).catch(() => Promise.reject(new Error(`photographs: ${frame.path} is not a picture`)));
  }
}

/** Keys of a lens, at the top of a `transforms` file or in a frame. */
const LENS = ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"];
interface Lens {
  camera_model?: unknown;
  is_fisheye?: unknown;
}

/** True if `keys` are of photographs that are not a pinhole's. */
function hasLens(keys: Lens): boolean {
  const isBent = LENS.some((key) => Number((keys as Record<string, unknown>)[key] ?? 0) !== 0);
  return isBent || keys.is_fisheye === true || /FISHEYE|EQUIRECTANGULAR/i.test(String(keys.camera_model ?? ""));
}

function framesOf(name: string, text: string): Frame[] {
  const wrong = (what: string): Error => new Error(`photographs: ${name}: ${what}`);
  let list: Lens & { frames?: (Lens & { file_path?: unknown; transform_matrix?: unknown })[] };
  try {
    list = JSON.parse(text) as typeof list;
  } catch {
    throw wrong("not JSON");
  }
  if (!Array.isArray(list?.frames)) throw wrong("has no frames");
  if ([list, ...list.frames].some((keys) => keys && hasLens(keys))) {
    throw wrong("the photographs have a lens, which a page does not undo; open them in the desktop player");
  }
  return list.frames.map((frame, n) => {
    const pose = Array.isArray(frame?.transform_matrix) ? frame.transform_matrix.flat().map(Number) : [];
    if (typeof frame?.file_path !== "string" || pose.length !== 16) {
      throw wrong(`frame ${n} needs file_path and a transform_matrix of 16 numbers`);
    }
    const path = frame.file_path.replaceAll("\\", "/").replace(/^(\.\/)+/, "");
    // Of a page it would be a request to any server: `//host/a.png` has the address of another.
    if (path.startsWith("/")) throw wrong(`frame ${n}: file_path must be relative; found ${path}`);
    return { path: /\.(png|jpe?g)$/i.test(path) ? path : `${path}.png`, pose };
  });
}

/** True if two cameras have the same position and direction. */
function isNear(a: ArrayLike<number>, b: ArrayLike<number>): boolean {
  const apart = (at: number): number => Math.abs((a[at] ?? NaN) - (b[at] ?? NaN));
  const far = Math.hypot(...[3, 7, 11].map((at) => b[at] ?? 0));
  return Array.from({ length: 12 }, (_, at) => at).every((at) => apart(at) <= NEAR * (at % 4 === 3 ? 1 + far : 1));
}

async function decoded(file: Blob, background: number[]): Promise<Photograph> {
  const bitmap = await createImageBitmap(file, { colorSpaceConversion: "none" });
  const smaller = Math.min(1, MOST_PIXELS / Math.max(bitmap.width, bitmap.height));
  const [width, height] = [bitmap.width, bitmap.height].map((v) => Math.max(1, Math.round(v * smaller)));
  const canvas = new OffscreenCanvas(width ?? 1, height ?? 1);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  if (!context) throw new Error("the canvas has no 2D context");
  context.fillStyle = `rgb(${background.map((v) => 255 * v).join(" ")})`;
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
  bitmap.close();
  const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
  return { width: canvas.width, height: canvas.height, bytes: new Uint8Array(data.buffer) };
}
