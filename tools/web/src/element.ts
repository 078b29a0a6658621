// <strivec-viewer src="scene.strivec">: a scene that can be walked around in.
//
//   src       the file; loaded in pieces, the coarse scale first, where the server answers ranges
//   camera    where to begin: what the property `camera` has said, comma-separated
//   controls  whether the panel is shown
//
// Fires `open` when the first picture of a file can be drawn, `load` when all of it is there, and `error` with a message.

import { element } from "./dom";
import css from "./element.css?inline";
import initialize, { Download, Player } from "./generated/strivec";
import { help } from "./help";
import { listen } from "./input";
import { load } from "./loading";
import { Panel } from "./panel";
import type { State } from "./state";

const NO_WEBGPU =
  "This browser has no WebGPU, which pictures are computed with.\n" +
  "Chrome and Edge from 113, Safari from 26 and Firefox from 141 have it on most systems, on https: pages and on localhost.";

const WELCOME = "Drop a .strivec file here, or open one with the panel's button (I shows the panel).\nH shows what keys and pointer do.";

/** How often the panel's numbers change while pictures are drawn, in milliseconds. */
const PANEL_EVERY = 250;

const MEGABYTE = 1e6;

/** One for all viewers of a page: the library. */
let library: Promise<unknown> | undefined;

const textOf = (error: unknown): string => (error instanceof Error ? error.message : String(error));

export class StrivecViewer extends HTMLElement {
  static readonly observedAttributes = ["src", "camera", "controls"];

  readonly #canvas = element("canvas", { tabIndex: 0 });
  readonly #stage = element("div", { id: "stage" });
  readonly #message = element("p", { id: "message" });
  readonly #welcome = element("p", { id: "welcome", textContent: WELCOME });
  readonly #help = help();
  readonly #panel: Panel;
  #player: Player | undefined;
  #starting: Promise<Player> | undefined;
  #name = "";
  /** Of the file that is being opened. */
  #opening: AbortController | undefined;
  #frame = 0;
  #panelAt = 0;
  #frames = 0;

  constructor() {
    super();
    this.#panel = new Panel({
      player: () => this.#player,
      wake: () => this.#wake(),
      open: (file) => void this.open(file),
      act: (action) => this.#act(action),
      fail: (error) => this.#fail(error),
    });
    this.#canvas.setAttribute("role", "application");
    this.#canvas.setAttribute("aria-label", "Scene: drag or use the arrow keys to turn around it, H for help");
    this.#message.setAttribute("role", "status");
    this.#message.setAttribute("aria-live", "polite");
    this.#stage.append(this.#canvas, this.#welcome, this.#message);
    this.#panel.root.hidden = true;
    const body = element("div", { id: "body" }, this.#stage, this.#panel.root);
    const root = this.attachShadow({ mode: "open" });
    root.append(element("style", { textContent: css }), body, this.#help);
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
    this.#opening?.abort();
    cancelAnimationFrame(this.#frame);
    this.#frame = 0;
  }

  attributeChangedCallback(name: string, _: string | null, value: string | null): void {
    if (name === "src" && value) void this.openUrl(value);
    if (name === "controls") this.#panel.root.hidden = value === null;
    if (name === "camera" && value && this.state) this.#applyCamera();
  }

  /** The open file's name. */
  get name(): string {
    return this.#name;
  }

  /** What is set and known; nothing where no file is open. */
  get state(): State | undefined {
    return (this.#player && (JSON.parse(this.#player.state) as State | null)) ?? undefined;
  }

  /**
   * 16 numbers, a row-major camera-to-world matrix in the dataset's space, and the degrees that the picture spans from top to
   * bottom.
   */
  get camera(): number[] | undefined {
    const camera = this.#player?.camera;
    return camera && [...camera];
  }

  set camera(numbers: number[]) {
    this.#player?.set_camera(new Float64Array(numbers));
    this.#wake();
  }

  /** Opens a file that is here. Whether it could be; a message says why not. */
  async open(file: File): Promise<boolean> {
    const { signal } = this.#begin(file.name);
    return this.#tried(signal, async () => {
      const [player, bytes] = await Promise.all([this.#start(), file.arrayBuffer()]);
      if (signal.aborted) return;
      player.open(new Uint8Array(bytes));
      this.#opened(file.name, true);
      this.#loaded();
    });
  }

  /** Opens the file at `url`. Whether it could be; a message says why not. */
  async openUrl(url: string): Promise<boolean> {
    const name = decodeURIComponent(new URL(url, document.baseURI).pathname.split("/").pop() ?? url);
    const { signal } = this.#begin(name);
    return this.#tried(signal, async () => {
      const player = await this.#start();
      const download = new Download();
      try {
        for (let isDone = false, isFirst = true; !isDone; ) {
          await load(url, download, (done, all) => this.#sayLoading(name, done, all), signal);
          signal.throwIfAborted();
          isDone = player.take(download);
          // A prefix that there is nothing to make up for is not shown.
          if (!download.has_scene) continue;
          this.#opened(name, isFirst);
          isFirst = false;
        }
        this.#loaded();
      } finally {
        download.free();
      }
    });
  }

  /** What is seen, as a PNG file; as large as the canvas where no size is given. */
  async screenshot(width = this.#canvas.width, height = this.#canvas.height): Promise<Blob> {
    const player = await this.#start();
    const pixels = await player.screenshot(width, height);
    this.#wake();
    return png(pixels as Uint8ClampedArray<ArrayBuffer>, width, height);
  }

  /**
   * The picture that `strivec render` makes from `pose`, 16 numbers, spanning `degrees` from left to right: red, green, blue and
   * opacity of each pixel.
   */
  async render(width: number, height: number, pose: number[], degrees: number): Promise<Uint8ClampedArray> {
    const player = await this.#start();
    return player.render(width, height, new Float64Array(pose), degrees);
  }

  #begin(name: string): AbortController {
    this.#opening?.abort();
    this.#opening = new AbortController();
    this.#say(`Opening ${name}…`);
    return this.#opening;
  }

  async #tried(signal: AbortSignal, work: () => Promise<void>): Promise<boolean> {
    try {
      await work();
      return !signal.aborted;
    } catch (error) {
      // Whoever opens something else does not care.
      if (!signal.aborted) this.#fail(error);
      return false;
    }
  }

  #opened(name: string, isFirst: boolean): void {
    this.#name = name;
    this.#welcome.hidden = true;
    this.#say("");
    if (isFirst) {
      this.#applyCamera();
      this.dispatchEvent(new CustomEvent("open"));
    }
    this.#panelAt = 0;
    this.#wake();
  }

  #loaded(): void {
    this.#say("");
    this.dispatchEvent(new CustomEvent("load"));
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
      this.#player = await Player.on(this.#canvas);
      return this.#player;
    })();
    return this.#starting;
  }

  /** Sees to it that frames are drawn until nothing changes. */
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
      this.#panel.show(this.state, this.#name);
    }
    this.dataset.frames = `${++this.#frames}`;
    if (hasMore) this.#wake();
  }

  #act(action: string): void {
    if (action === "help") this.#help.showModal();
    if (action === "panel") this.toggleAttribute("controls");
    if (action === "screenshot") void this.#save();
    if (action === "record" || action === "play") this.#say("Paths are recorded and played by the desktop's player.");
    this.#panelAt = 0;
    this.#wake();
  }

  async #save(): Promise<void> {
    try {
      const file = URL.createObjectURL(await this.screenshot());
      element("a", { href: file, download: `${this.#name.replace(/\.strivec$/, "") || "scene"}.png` }).click();
      setTimeout(() => URL.revokeObjectURL(file), 10_000);
    } catch (error) {
      this.#fail(error);
    }
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
      const file = event.dataTransfer?.files[0];
      if (file) void this.open(file);
    });
  }

  #sayLoading(name: string, done: number, all: number | undefined): void {
    const of = all === undefined ? "" : ` of ${(all / MEGABYTE).toFixed(1)}`;
    this.#say(`Loading ${name}: ${(done / MEGABYTE).toFixed(1)}${of} MB`);
  }

  #say(text: string): void {
    this.#message.classList.remove("failed");
    this.#message.textContent = text;
  }

  #fail(error: unknown): void {
    console.error(error);
    // A panic in the library: what it was about is on the console.
    const died = error instanceof WebAssembly.RuntimeError;
    const text = died ? "The viewer has crashed. This browser's console says why." : textOf(error);
    this.#message.classList.add("failed");
    this.#message.textContent = text;
    if (this.state === undefined) this.#welcome.hidden = true;
    this.dispatchEvent(new CustomEvent("error", { detail: text }));
  }
}

async function png(pixels: Uint8ClampedArray<ArrayBuffer>, width: number, height: number): Promise<Blob> {
  const canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext("2d");
  if (!context) throw new Error("the canvas has no 2D context");
  context.putImageData(new ImageData(pixels, width, height), 0, 0);
  return canvas.convertToBlob({ type: "image/png" });
}
