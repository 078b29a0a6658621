// <strivec-viewer src="scene.strivec">: an interactive view of a scene.
//
//   src       the file; loaded in pieces, the coarse scale first, if the server supports ranges
//   camera    the first camera: the numbers of the property `camera`, comma-separated
//   controls  shows the panel
//   compare   a file to compare it with
//   quality   a quality setting stored in the file: fast, balanced or best
//   data      the dataset's list of training cameras (transforms_train.json), for its photographs
//
// Fires `open` when the first picture of a file can be drawn, `load` when the whole file is loaded, and `error` with a message.

import { Divider } from "./divider";
import { element, escaped } from "./dom";
import css from "./element.css?inline";
import initialize, { Download, keys, Player } from "./generated/strivec";
import { Help } from "./help";
import { listen } from "./input";
import { load } from "./loading";
import { Panel } from "./panel";
import { Photographs } from "./photographs";
import type { State } from "./state";

const NO_WEBGPU =
  "This browser has no WebGPU, which the viewer needs to draw.\n" +
  "Chrome and Edge from 113, Safari from 26 and Firefox from 141 have it on most systems, on https: pages and on localhost.";

const WELCOME = "Drop a .strivec file here, or open one from the panel (I shows the panel).\nH shows the keys.";

/** Interval between updates of the panel while pictures are drawn, in milliseconds. */
const PANEL_EVERY = 250;

const MEGABYTE = 1e6;

/** The library, loaded once for all viewers of a page. */
let library: Promise<unknown> | undefined;

/** 0 is the scene, 1 the one that it is compared with. */
type Place = 0 | 1;

const textOf = (error: unknown): string => (error instanceof Error ? error.message : String(error));

export class StrivecViewer extends HTMLElement {
  static readonly observedAttributes = ["src", "camera", "controls", "compare", "data", "quality"];

  readonly #canvas = element("canvas", { tabIndex: 0 });
  readonly #stage = element("div", { id: "stage" });
  readonly #message = element("p", { id: "message" });
  readonly #welcome = element("p", { id: "welcome", textContent: WELCOME });
  readonly #help = new Help();
  readonly #panel: Panel;
  #player: Player | undefined;
  #starting: Promise<Player> | undefined;
  readonly #divider = new Divider((at) => (this.divider = at));
  readonly #names: [string, string] = ["", ""];
  /** Abort controllers of the files that are being opened. */
  readonly #opening: [AbortController?, AbortController?] = [];
  #photographs: Photographs | undefined;
  /** True while a photograph is being loaded. */
  #isFetching = false;
  #frame = 0;
  #panelAt = 0;
  #frames = 0;

  constructor() {
    super();
    this.#panel = new Panel({
      player: () => this.#player,
      wake: () => this.#wake(),
      open: (file) => void this.open(file),
      compare: (file) => void this.compare(file),
      photographs: (files) => void this.photographs(files),
      hasPhotographs: () => this.#photographs !== undefined,
      act: (action) => this.#act(action),
      fail: (error) => this.#fail(error),
    });
    this.#canvas.setAttribute("role", "application");
    this.#canvas.setAttribute("aria-label", "Scene: drag or use the arrow keys to turn around it, H for help");
    this.#message.setAttribute("role", "status");
    this.#message.setAttribute("aria-live", "polite");
    this.#stage.append(this.#canvas, this.#divider.root, this.#welcome, this.#message);
    this.#panel.root.hidden = true;
    const body = element("div", { id: "body" }, this.#stage, this.#panel.root);
    const root = this.attachShadow({ mode: "open" });
    root.append(element("style", { textContent: css }), body, this.#help.root);
    listen(this.#canvas, this, {
      player: () => this.#player,
      wake: () => this.#wake(),
      act: (action) => this.#act(action),
    });
    this.#listenForFiles();
    new ResizeObserver(() => this.#wake()).observe(this.#canvas);
  }

  connectedCallback(): void {
    this.#start().then(
      () => this.#wake(),
      (error: unknown) => this.#fail(error),
    );
  }

  disconnectedCallback(): void {
    for (const opening of this.#opening) opening?.abort();
    cancelAnimationFrame(this.#frame);
    this.#frame = 0;
  }

  attributeChangedCallback(name: string, _: string | null, value: string | null): void {
    if (name === "src" && value) void this.openUrl(value);
    if (name === "compare") void this.compare(value ?? undefined);
    if (name === "data" && value) void this.photographs(value);
    if (name === "controls") this.#panel.root.hidden = value === null;
    if (name === "camera" && value && this.state) this.#applyCamera();
    if (name === "quality" && this.state) this.#applyQuality();
  }

  /** Name of the open file. */
  get name(): string {
    return this.#names[0];
  }

  /** Settings, facts of the file and progress; undefined if no file is open. */
  get state(): State | undefined {
    return (this.#player && (JSON.parse(this.#player.state) as State | null)) ?? undefined;
  }

  /**
   * The camera: 16 numbers, a row-major camera-to-world matrix in the dataset's space, and the vertical angle of view in
   * degrees.
   */
  get camera(): number[] | undefined {
    const camera = this.#player?.camera;
    return camera && [...camera];
  }

  set camera(numbers: number[]) {
    this.#player?.set_camera(new Float64Array(numbers));
    this.#wake();
  }

  /** Position of the divider of two scenes in parts of the width; undefined if they are side by side. */
  get divider(): number | undefined {
    return this.state?.divider ?? undefined;
  }

  set divider(at: number | undefined) {
    this.#player?.set_divider(at);
    this.#changed();
  }

  /** Number of the chosen training camera of the file, from 0. Setting it moves the camera there. */
  get trainingCamera(): number | undefined {
    return this.state?.camera ?? undefined;
  }

  set trainingCamera(number: number) {
    this.#player?.go_to_camera(number);
    this.#changed();
  }

  /** Share of its photograph in the picture, from 0 to 1. */
  get photographShare(): number {
    return this.state?.photograph ?? 0;
  }

  set photographShare(share: number) {
    this.#player?.set_photograph_share(share);
    this.#changed();
  }

  /** The camera path that was recorded or opened last, as JSON (docs/camera-paths.md). Setting it plays it. */
  get path(): string | undefined {
    return this.#player?.path;
  }

  set path(text: string) {
    this.#player?.open_path(new TextEncoder().encode(text));
    this.#changed();
  }

  /** Opens a local file, a scene or a camera path. On failure returns false and shows a message. */
  async open(file: File): Promise<boolean> {
    return isJson(file) ? this.#openPath(file) : this.#openFile(file, 0);
  }

  /** Opens the file at `url`. On failure returns false and shows a message. */
  async openUrl(url: string): Promise<boolean> {
    return this.#openUrl(url, 0);
  }

  /** Compares the scene with a file or an address; without argument, ends the comparison. Returns false on failure. */
  async compare(file?: File | string): Promise<boolean> {
    if (typeof file === "string") return this.#openUrl(file, 1);
    if (file) return this.#openFile(file, 1);
    this.#opening[1]?.abort();
    this.#player?.close_second();
    this.#say("");
    this.#changed();
    return true;
  }

  /**
   * Sets the photographs: the address of a dataset's `transforms` file, the files of its folder, or a dropped folder. On
   * failure returns false and shows a message.
   */
  async photographs(from: string | Iterable<File> | FileSystemDirectoryEntry): Promise<boolean> {
    return this.#tried(undefined, async () => {
      if (typeof from === "string") this.#photographs = await Photographs.ofUrl(from);
      else if (Symbol.iterator in from) this.#photographs = await Photographs.ofFiles(from);
      else this.#photographs = await Photographs.ofFolder(from);
      this.#changed();
    });
  }

  async #openFile(file: File, place: Place): Promise<boolean> {
    const { signal } = this.#begin(file.name, place);
    return this.#tried(signal, async () => {
      const [player, bytes] = await Promise.all([this.#start(), file.arrayBuffer()]);
      if (signal.aborted) return;
      player.open(new Uint8Array(bytes), place);
      this.#opened(file.name, place, true);
      this.#loaded(place);
    });
  }

  async #openUrl(url: string, place: Place): Promise<boolean> {
    const name = decodeURIComponent(new URL(url, document.baseURI).pathname.split("/").pop() ?? url);
    const { signal } = this.#begin(name, place);
    return this.#tried(signal, async () => {
      const player = await this.#start();
      const download = new Download();
      try {
        for (let isDone = false, isFirst = true; !isDone; ) {
          await load(url, download, (done, all) => this.#sayLoading(name, done, all), signal);
          signal.throwIfAborted();
          isDone = player.take(download, place);
          // A prefix without a correction is not shown.
          if (!download.has_scene) continue;
          this.#opened(name, place, isFirst);
          isFirst = false;
        }
        this.#loaded(place);
      } finally {
        download.free();
      }
    });
  }

  async #openPath(file: File): Promise<boolean> {
    return this.#tried(undefined, async () => {
      const [player, bytes] = await Promise.all([this.#start(), file.arrayBuffer()]);
      try {
        player.open_path(new Uint8Array(bytes));
      } catch (error) {
        throw new Error(`${file.name}: ${textOf(error)}`);
      }
      this.#say("");
      this.#changed();
    });
  }

  /** The current view as a PNG file; the default size is the canvas's. */
  async screenshot(width = this.#canvas.width, height = this.#canvas.height): Promise<Blob> {
    const player = await this.#start();
    const pixels = await player.screenshot(width, height);
    this.#wake();
    return png(pixels as Uint8ClampedArray<ArrayBuffer>, width, height);
  }

  /**
   * The picture of `strivec render` from `pose`, 16 numbers, with a horizontal angle of view of `degrees`: red, green, blue
   * and opacity of each pixel.
   */
  async render(width: number, height: number, pose: number[], degrees: number): Promise<Uint8ClampedArray> {
    const player = await this.#start();
    return player.render(width, height, new Float64Array(pose), degrees);
  }

  #begin(name: string, place: Place): AbortController {
    this.#opening[place]?.abort();
    const opening = (this.#opening[place] = new AbortController());
    this.#say(`Opening ${name}…`);
    return opening;
  }

  async #tried(signal: AbortSignal | undefined, work: () => Promise<void>): Promise<boolean> {
    try {
      await work();
      return !signal?.aborted;
    } catch (error) {
      // Another file was opened meanwhile.
      if (!signal?.aborted) this.#fail(error);
      return false;
    }
  }

  #opened(name: string, place: Place, isFirst: boolean): void {
    this.#names[place] = name;
    this.#say("");
    if (place === 0) this.#welcome.hidden = true;
    if (place === 0 && isFirst) {
      this.#applyCamera();
      this.dispatchEvent(new CustomEvent("open"));
    }
    this.#changed();
  }

  #loaded(place: Place): void {
    this.#say("");
    if (place === 0) {
      this.#applyQuality();
      this.dispatchEvent(new CustomEvent("load"));
    }
    this.#wake();
  }

  #applyQuality(): void {
    const quality = this.getAttribute("quality");
    if (quality) this.#player?.choose(quality);
    this.#wake();
  }

  #applyCamera(): void {
    const camera = this.getAttribute("camera");
    if (!camera) return;
    try {
      this.#player?.set_camera(new Float64Array(camera.split(",").map(Number)));
    } catch (error) {
      this.#fail(error);
    }
    this.#wake();
  }

  #start(): Promise<Player> {
    this.#starting ??= (async () => {
      if (!("gpu" in navigator)) throw new Error(NO_WEBGPU);
      await (library ??= initialize());
      this.#help.fill(JSON.parse(keys()) as [string, string][]);
      this.#player = await Player.on(this.#canvas);
      return this.#player;
    })();
    return this.#starting;
  }

  /** Updates the panel in the next frame. */
  #changed(): void {
    this.#panelAt = 0;
    this.#wake();
  }

  /** Draws frames until nothing changes. */
  #wake(): void {
    if (this.#frame || !this.#player || !this.isConnected) return;
    this.#frame = requestAnimationFrame((now) => {
      this.#frame = 0;
      this.#draw(now);
    });
  }

  #draw(now: number): void {
    const box = this.#canvas.getBoundingClientRect();
    const [width, height] = [box.width, box.height].map((v) => Math.max(1, Math.round(v * devicePixelRatio)));
    if (!this.#player || !width || !height) return;
    let hasMore = false;
    try {
      hasMore = this.#player.frame(now, width, height);
    } catch (error) {
      this.#fail(error);
    }
    if (!hasMore || now - this.#panelAt > PANEL_EVERY) {
      this.#panelAt = now;
      const { state } = this;
      this.#panel.show(state, this.#names);
      this.#divider.show(state?.second ? state.divider : null);
      void this.#fetchPhotograph(state);
    }
    this.dataset.frames = `${++this.#frames}`;
    if (hasMore) this.#wake();
  }

  #act(action: string): void {
    if (action === "help") this.#help.root.showModal();
    if (action === "panel") this.toggleAttribute("controls");
    if (action === "screenshot") void this.#saveScreenshot();
    if (action === "record" && this.#player?.record()) this.#savePath();
    if (action === "play" && this.#player?.play()) this.#savePath();
    this.#changed();
  }

  /** Loads the photograph of the chosen training camera if it is to be shown and missing. */
  async #fetchPhotograph(state: State | undefined): Promise<void> {
    const number = state?.camera;
    if (!this.#photographs || this.#isFetching || !state?.photograph || state.has_photograph) return;
    const [player, pose, [name]] = [this.#player, this.#player?.training_camera(number ?? NaN), this.#names];
    if (!player || typeof number !== "number" || !pose) return;
    this.#isFetching = true;
    try {
      const { width, height, bytes } = await this.#photographs.at(pose, state.own_background);
      // Another file has other cameras.
      if (name === this.#names[0]) player.set_photograph(number, width, height, bytes);
    } catch (error) {
      player.set_photograph_share(0);
      this.#fail(error);
    } finally {
      this.#isFetching = false;
      this.#changed();
    }
  }

  async #saveScreenshot(): Promise<void> {
    try {
      this.#save(await this.screenshot(), ".png");
    } catch (error) {
      this.#fail(error);
    }
  }

  #savePath(): void {
    if (this.path) this.#save(new Blob([this.path], { type: "application/json" }), "-path.json");
  }

  /** Downloads a file named as the scene, with this ending. */
  #save(file: Blob, ending: string): void {
    const href = URL.createObjectURL(file);
    element("a", { href, download: `${this.name.replace(/\.strivec$/, "") || "scene"}${ending}` }).click();
    setTimeout(() => URL.revokeObjectURL(href), 10_000);
  }

  #listenForFiles(): void {
    const over = (event: DragEvent, isOver: boolean): void => {
      event.preventDefault();
      this.#stage.classList.toggle("dropping", isOver);
    };
    this.addEventListener("dragover", (event) => over(event, true));
    this.addEventListener("dragleave", (event) => over(event, false));
    this.addEventListener("drop", (event) => {
      over(event, false);
      if (event.dataTransfer) this.#dropped(event.dataTransfer, event.ctrlKey || event.metaKey);
    });
  }

  /** Opens dropped files: a scene, a scene to compare with, a camera path, or a dataset. */
  #dropped({ items, files }: DataTransfer, isCompared: boolean): void {
    const folder = [...items].map((item) => item.webkitGetAsEntry()).find((entry) => entry?.isDirectory);
    if (folder) {
      void this.photographs(folder as FileSystemDirectoryEntry);
    } else if (files.length > 1 && [...files].some((file) => /^transforms.*\.json$/.test(file.name))) {
      void this.photographs(files);
    } else {
      const [first, second] = files;
      if (first) void (isCompared && !isJson(first) ? this.compare(first) : this.open(first));
      if (second) void this.compare(second);
    }
  }

  #sayLoading(name: string, done: number, all: number | undefined): void {
    const of = all === undefined ? "" : ` of ${(all / MEGABYTE).toFixed(1)}`;
    this.#say(`Loading ${name}: ${(done / MEGABYTE).toFixed(1)}${of} MB`);
  }

  #say(text: string): void {
    this.#message.classList.remove("failed");
    this.#message.textContent = escaped(text);
  }

  #fail(error: unknown): void {
    console.error(error);
    // A panic in the library; its message is on the console.
    const died = error instanceof WebAssembly.RuntimeError;
    const text = died ? "The viewer has crashed; see the browser's console." : textOf(error);
    this.#message.classList.add("failed");
    this.#message.textContent = escaped(text);
    if (this.state === undefined) this.#welcome.hidden = true;
    this.dispatchEvent(new CustomEvent("error", { detail: text }));
  }
}

const isJson = (file: File): boolean => /\.json$/i.test(file.name);

async function png(pixels: Uint8ClampedArray<ArrayBuffer>, width: number, height: number): Promise<Blob> {
  const canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext("2d");
  if (!context) throw new Error("the canvas has no 2D context");
  context.putImageData(new ImageData(pixels, width, height), 0, 0);
  return canvas.convertToBlob({ type: "image/png" });
}
