// The panel: settings, speed, and facts of the files.

import { element, escaped } from "./dom";
import type { Player } from "./generated/strivec";
import type { Opened, State } from "./state";

/** Milliseconds that a picture may take while the camera moves, at first. */
const FRAME_TIME = 33;

/** The viewer, as the panel uses it. */
export interface Owner {
  player(): Player | undefined;
  /** Something was changed. */
  wake(): void;
  open(file: File): void;
  /** Compares with `file`, or with nothing. */
  compare(file?: File): void;
  /** Takes the files of a dataset's folder. */
  photographs(files: FileList): void;
  hasPhotographs(): boolean;
  act(action: string): void;
  fail(error: unknown): void;
}

interface Slider {
  row: HTMLElement;
  input: HTMLInputElement;
  show(value: number): void;
}

/** A slider with its label; `text` formats a value. A logarithmic slider moves by powers of two. */
function slider(label: string, min: number, max: number, step: number, text: (value: number) => string): Slider {
  const input = element("input", { type: "range", min: `${min}`, max: `${max}`, step: `${step}` });
  const output = element("output");
  const row = element("label", { className: "slider" }, element("span", { textContent: label }), input, output);
  const say = (): void => {
    output.textContent = text(input.valueAsNumber);
    input.setAttribute("aria-valuetext", output.textContent);
  };
  // While it is dragged, updates do not move it.
  let isMoving = false;
  input.addEventListener("input", () => {
    isMoving = true;
    say();
  });
  input.addEventListener("change", () => (isMoving = false));
  const show = (value: number): void => {
    if (isMoving) return;
    input.value = `${value}`;
    say();
  };
  return { row, input, show };
}

function capitalized(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}

function hex(color: number[]): string {
  return "#" + color.map((v) => Math.round(255 * Math.min(Math.max(v, 0), 1)).toString(16).padStart(2, "0")).join("");
}

/** A button that opens the browser's file chooser. */
function chooser(text: string, properties: Partial<HTMLInputElement>, choose: (files: FileList) => void): HTMLElement {
  const input = element("input", { type: "file", ...properties });
  input.addEventListener("change", () => {
    if (input.files?.length) choose(input.files);
    input.value = "";
  });
  return element("label", { className: "file" }, text, input);
}

function showFacts(list: HTMLElement, { facts }: Opened): void {
  const text = JSON.stringify(facts);
  if (text === list.dataset.facts) return;
  list.dataset.facts = text;
  list.replaceChildren(
    ...facts.map(({ name, value }) =>
      element("div", {}, element("dt", { textContent: name }), element("dd", { textContent: value })),
    ),
  );
}

const soFar = ({ scales, all_scales, is_whole }: Opened): string =>
  is_whole ? "" : `${scales} of ${all_scales} scales loaded`;

function section(title: string, ...children: Node[]): HTMLElement {
  return element("section", {}, element("h2", { textContent: title }), ...children);
}

export class Panel {
  readonly root = element("aside", { id: "panel" });
  readonly #owner: Owner;
  readonly #name = element("h1");
  readonly #arrived = element("p", { className: "weak" });
  readonly #speed = element("p", { id: "speed" });
  readonly #choices = element("div", { className: "row" });
  readonly #views = element("div", { className: "row" });
  readonly #background = element("input", { type: "color" });
  readonly #boxes = element("input", { type: "checkbox" });
  readonly #boxesOf = element("div", { className: "row" });
  readonly #facts = element("dl", { id: "facts" });
  readonly #step = slider("Step", -1, 3, 0.25, (v) => `×${(2 ** v).toFixed(2)}`);
  readonly #threshold = slider("Color threshold", -20, -4, 0.25, (v) => (2 ** v).toExponential(0));
  readonly #finest = slider("Resolution", 0, 4, 1, (v) => `1/${2 ** v}`);
  readonly #frameTime = slider("ms while moving", 5, 500, 1, (v) => `${v}`);
  readonly #record: HTMLButtonElement;
  readonly #play: HTMLButtonElement;
  readonly #near = slider("Near", 0, 1, 0.001, (v) => `${Number(v.toPrecision(2))}`);
  readonly #camera = slider("Training camera", 1, 1, 1, (v) => `${v}`);
  readonly #photograph = slider("Photograph", 0, 1, 0.05, (v) => `${Math.round(100 * v)} %`);
  readonly #folder: HTMLElement;
  readonly #second = element("div");
  readonly #secondName = element("p");
  readonly #secondFacts = element("dl");
  readonly #sideBySide = element("input", { type: "checkbox" });
  readonly #scene: HTMLElement;
  #state: State | undefined;

  constructor(owner: Owner) {
    this.#owner = owner;
    this.root.setAttribute("aria-label", "Scene and settings");
    const open = chooser("Open…", { accept: ".strivec,.json", id: "file" }, ([file]) => file && owner.open(file));
    this.#views.setAttribute("role", "radiogroup");
    this.#views.setAttribute("aria-label", "View");

    const own = this.#button("As trained", (player) => player.set_background(new Float32Array()));
    this.#background.addEventListener("input", () => {
      const color = [1, 3, 5].map((at) => parseInt(this.#background.value.slice(at, at + 2), 16) / 255);
      this.#do((player) => player.set_background(new Float32Array(color)));
    });
    this.#boxes.addEventListener("change", () => this.#do((player) => player.set_boxes(this.#boxes.checked)));

    for (const { input } of [this.#step, this.#threshold, this.#finest]) {
      input.addEventListener("change", () => this.#setQuality());
    }
    const exact = this.#button("exact", (player) => player.set_quality(1, undefined, 1));
    this.#frameTime.show(FRAME_TIME);
    this.#frameTime.input.addEventListener("change", () =>
      this.#do((player) => player.set_frame_time(this.#frameTime.input.valueAsNumber)),
    );

    this.#record = this.#key("Record path", "KeyC");
    this.#play = this.#key("Play path", "Space");
    this.#near.input.addEventListener("input", () => this.#do((player) => player.set_near(this.#near.input.valueAsNumber)));
    this.#camera.input.addEventListener("input", () =>
      this.#do((player) => player.go_to_camera(this.#camera.input.valueAsNumber - 1)),
    );
    this.#photograph.input.addEventListener("input", () =>
      this.#do((player) => player.set_photograph_share(this.#photograph.input.valueAsNumber)),
    );
    this.#folder = chooser("Folder of photographs…", { webkitdirectory: true }, (files) => owner.photographs(files));
    const compare = chooser("Compare with…", { accept: ".strivec" }, ([file]) => file && owner.compare(file));
    this.#sideBySide.addEventListener("change", () =>
      this.#do((player) => player.set_divider(this.#sideBySide.checked ? undefined : 0.5)),
    );
    const close = this.#button("Close", () => owner.compare());
    this.#second.append(
      element("div", { className: "row" }, element("label", {}, this.#sideBySide, " Side by side"), close),
      this.#secondName,
      this.#secondFacts,
    );

    this.#scene = element(
      "div",
      { hidden: true },
      section(
        "View",
        this.#views,
        element("div", { className: "row" }, element("label", {}, "Background ", this.#background), own),
        element("label", {}, this.#boxes, " Tensor boxes"),
        this.#boxesOf,
      ),
      section(
        "Quality",
        this.#step.row,
        this.#threshold.row,
        this.#finest.row,
        this.#frameTime.row,
        element("div", { className: "row" }, exact, this.#choices),
      ),
      section(
        "Camera",
        element("div", { className: "row" }, this.#record, this.#play),
        this.#near.row,
        this.#camera.row,
        this.#photograph.row,
        this.#folder,
      ),
      section("File", this.#facts),
      section("Comparison", compare, this.#second),
    );
    const buttons = [this.#key("First view", "KeyR"), this.#key("Screenshot", "KeyP"), this.#key("Help", "KeyH")];
    this.root.append(
      element("div", { className: "row" }, open, ...buttons),
      this.#name,
      this.#arrived,
      this.#speed,
      this.#scene,
    );
  }

  /** Updates the panel. */
  show(state: State | undefined, names: [string, string]): void {
    this.#state = state;
    this.#scene.hidden = !state;
    this.#name.textContent = state ? escaped(names[0]) : "";
    this.#arrived.hidden = !state || state.is_whole;
    this.#speed.hidden = !state;
    if (!state) return;
    this.#arrived.textContent = soFar(state);
    this.#showSpeed(state);
    this.#showViews(state);
    this.#background.value = hex(state.background);
    this.#background.disabled = !state.shows_background;
    this.#boxes.checked = state.has_boxes;
    this.#showBoxes(state);
    this.#showChoices(state);
    const { quality } = state;
    this.#step.show(Math.log2(quality.step));
    this.#threshold.show(Math.log2(Math.max(quality.threshold, 2 ** -20)));
    this.#finest.show(Math.log2(quality.finest));
    showFacts(this.#facts, state);
    this.#showCamera(state);
    this.#second.hidden = !state.second;
    if (!state.second) return;
    this.#secondName.textContent = [escaped(names[1]), soFar(state.second)].filter(Boolean).join(", ");
    this.#sideBySide.checked = state.divider === null;
    showFacts(this.#secondFacts, state.second);
  }

  #showCamera(state: State): void {
    this.#record.textContent = state.is_recording ? "Stop recording" : "Record path";
    this.#play.textContent = state.is_playing ? "Stop" : "Play path";
    const [near, most] = state.near;
    this.#near.input.max = `${most}`;
    this.#near.input.step = `${most / 500}`;
    this.#near.show(near);
    this.#camera.row.hidden = state.cameras === 0;
    this.#camera.input.max = `${state.cameras}`;
    this.#camera.show((state.camera ?? 0) + 1);
    this.#photograph.row.hidden = state.cameras === 0 || !this.#owner.hasPhotographs();
    this.#photograph.show(state.photograph);
    this.#folder.hidden = state.cameras === 0;
  }

  #showSpeed(state: State): void {
    const milliseconds = (value: number | null): string => (value === null ? "…" : `${value.toFixed(1)} ms`);
    const parts = [`Full picture: ${milliseconds(state.milliseconds)}`];
    if (state.milliseconds_before !== null) parts.push(`before: ${milliseconds(state.milliseconds_before)}`);
    if (state.rays_per_second !== null) parts.push(`${Math.round(1e-3 * state.rays_per_second)} thousand rays/s`);
    if (state.divisor !== null && state.divisor > state.quality.finest) parts.push(`resolution 1/${state.divisor}`);
    if (state.memory_bytes) {
      const [scene, work] = state.memory_bytes.map((bytes) => (bytes / 1e6).toFixed(0));
      parts.push(`device memory: scene ${scene} MB, workspace ${work} MB`);
    }
    if (state.device) parts.push(state.device);
    this.#speed.textContent = escaped(parts.join(" · "));
  }

  #showViews(state: State): void {
    if (this.#views.childElementCount === 0) {
      for (const view of state.views) {
        const input = element("input", { type: "radio", name: "view", value: view });
        input.addEventListener("change", () => this.#do((player) => player.set_view(view)));
        this.#views.append(element("label", { className: "choice" }, input, capitalized(view)));
      }
    }
    for (const input of this.#views.querySelectorAll("input")) input.checked = input.value === state.view;
  }

  #showChoices({ choices }: State): void {
    const shown = [...this.#choices.children].map((button) => button.textContent);
    if (choices.join() === shown.join()) return;
    this.#choices.replaceChildren(...choices.map((name) => this.#button(name, (player) => player.choose(name))));
  }

  #showBoxes(state: State): void {
    this.#boxesOf.hidden = !state.has_boxes;
    while (this.#boxesOf.childElementCount > state.boxes.length) this.#boxesOf.lastElementChild?.remove();
    while (this.#boxesOf.childElementCount < state.boxes.length) {
      const scale = this.#boxesOf.childElementCount;
      const input = element("input", { type: "checkbox" });
      input.addEventListener("change", () => this.#do((player) => player.set_boxes_of(scale, input.checked)));
      this.#boxesOf.append(element("label", {}, input, ` Scale ${scale}`));
    }
    this.#boxesOf.querySelectorAll("input").forEach((input, scale) => (input.checked = state.boxes[scale] ?? false));
  }

  #setQuality(): void {
    const state = this.#state;
    if (!state) return;
    const { quality } = state;
    const value = (slider: Slider): number => slider.input.valueAsNumber;
    const threshold = 2 ** value(this.#threshold);
    // The slider's nearest position to the scene's own value means that value.
    const isOwn = Math.abs(Math.log2(threshold / Math.max(quality.own_threshold, 2 ** -20))) < 0.13;
    this.#do((player) =>
      player.set_quality(2 ** value(this.#step), isOwn ? undefined : threshold, 2 ** value(this.#finest)),
    );
  }

  /** A button that does what the key of W3C code `code` does. */
  #key(text: string, code: string): HTMLButtonElement {
    return this.#button(text, (player) => {
      const action = player.key(code, true, false);
      if (action) this.#owner.act(action);
    });
  }

  #button(text: string, press: (player: Player) => void): HTMLButtonElement {
    const button = element("button", { type: "button", textContent: text });
    button.addEventListener("click", () => this.#do(press));
    return button;
  }

  #do(change: (player: Player) => void): void {
    const player = this.#owner.player();
    if (!player) return;
    try {
      change(player);
    } catch (error) {
      this.#owner.fail(error);
    }
    this.#owner.wake();
  }
}
