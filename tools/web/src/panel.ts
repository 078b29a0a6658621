// The panel: what can be set, and what is known.

import { element } from "./dom";
import type { Player } from "./generated/strivec";
import type { State } from "./state";

/** Milliseconds that a picture may take while the camera moves, at first. */
const FRAME_TIME = 33;

/** What the panel asks of the viewer. */
export interface Owner {
  player(): Player | undefined;
  /** Something was changed. */
  wake(): void;
  open(file: File): void;
  act(action: string): void;
  fail(error: unknown): void;
}

interface Slider {
  row: HTMLElement;
  input: HTMLInputElement;
  show(value: number): void;
}

/** A slider with its label; `text` says what a value stands for. Where it is logarithmic, it moves by powers of two. */
function slider(label: string, min: number, max: number, step: number, text: (value: number) => string): Slider {
  const input = element("input", { type: "range", min: `${min}`, max: `${max}`, step: `${step}` });
  const output = element("output");
  const row = element("label", { className: "slider" }, element("span", { textContent: label }), input, output);
  const say = (): void => {
    output.textContent = text(input.valueAsNumber);
    input.setAttribute("aria-valuetext", output.textContent);
  };
  // While it is being moved, it stays in the hand that moves it.
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

function hex(color: number[]): string {
  return "#" + color.map((v) => Math.round(255 * Math.min(Math.max(v, 0), 1)).toString(16).padStart(2, "0")).join("");
}

function section(title: string, ...children: Node[]): HTMLElement {
  return element("section", {}, element("h2", { textContent: title }), ...children);
}

export class Panel {
  readonly root = element("aside", { id: "panel" });
  readonly #owner: Owner;
  readonly #name = element("h1");
  readonly #arrived = element("p", { className: "weak" });
  readonly #speed = element("p", { id: "speed" });
  readonly #views = element("div", { className: "row" });
  readonly #background = element("input", { type: "color" });
  readonly #boxes = element("input", { type: "checkbox" });
  readonly #boxesOf = element("div", { className: "row" });
  readonly #facts = element("dl", { id: "facts" });
  readonly #neighbours = slider("neighbours", 1, 4, 1, (v) => `${v}`);
  readonly #scales = slider("scales", 1, 1, 1, (v) => `${v}`);
  readonly #step = slider("step", -1, 3, 0.25, (v) => `×${(2 ** v).toFixed(2)}`);
  readonly #threshold = slider("threshold", -20, -4, 0.25, (v) => (2 ** v).toExponential(0));
  readonly #finest = slider("resolution", 0, 4, 1, (v) => `1/${2 ** v}`);
  readonly #frameTime = slider("moving, ms", 5, 500, 1, (v) => `${v}`);
  readonly #scene: HTMLElement;
  #state: State | undefined;
  #factsShown = "";

  constructor(owner: Owner) {
    this.#owner = owner;
    this.root.setAttribute("aria-label", "Scene and settings");
    const file = element("input", { type: "file", accept: ".strivec", id: "file" });
    file.addEventListener("change", () => {
      const chosen = file.files?.[0];
      if (chosen) owner.open(chosen);
      file.value = "";
    });
    this.#views.setAttribute("role", "radiogroup");
    this.#views.setAttribute("aria-label", "View");

    const own = this.#button("as trained", (player) => player.set_background(new Float32Array()));
    this.#background.addEventListener("input", () => {
      const color = [1, 3, 5].map((at) => parseInt(this.#background.value.slice(at, at + 2), 16) / 255);
      this.#do((player) => player.set_background(new Float32Array(color)));
    });
    this.#boxes.addEventListener("change", () => this.#do((player) => player.set_boxes(this.#boxes.checked)));

    for (const { input } of [this.#neighbours, this.#scales, this.#step, this.#threshold, this.#finest]) {
      input.addEventListener("change", () => this.#setQuality());
    }
    const exact = this.#button("exact", (player) => player.set_quality(undefined, undefined, 1, undefined, 1));
    this.#frameTime.show(FRAME_TIME);
    this.#frameTime.input.addEventListener("change", () =>
      this.#do((player) => player.set_frame_time(this.#frameTime.input.valueAsNumber)),
    );

    this.#scene = element(
      "div",
      { hidden: true },
      section(
        "View",
        this.#views,
        element("div", { className: "row" }, element("label", {}, "background ", this.#background), own),
        element("label", {}, this.#boxes, " tensor boxes"),
        this.#boxesOf,
      ),
      section(
        "Quality",
        this.#neighbours.row,
        this.#scales.row,
        this.#step.row,
        this.#threshold.row,
        this.#finest.row,
        this.#frameTime.row,
        exact,
      ),
      section("File", this.#facts),
    );
    const buttons = [
      ["reset", "KeyR"],
      ["screenshot", "KeyP"],
      ["help", "KeyH"],
    ].map(([text = "", code = ""]) =>
      this.#button(text, (player) => {
        const action = player.key(code, true, false);
        if (action) owner.act(action);
      }),
    );
    this.root.append(
      element("div", { className: "row" }, element("label", { className: "file" }, "open", file), ...buttons),
      this.#name,
      this.#arrived,
      this.#speed,
      this.#scene,
    );
  }

  /** Shows what there is to know. */
  show(state: State | undefined, name: string): void {
    this.#state = state;
    this.#scene.hidden = !state;
    this.#name.textContent = state ? name : "";
    this.#arrived.hidden = !state || state.is_whole;
    this.#speed.hidden = !state;
    if (!state) return;
    this.#arrived.textContent = `${state.scales} of ${state.all_scales} scales so far`;
    this.#showSpeed(state);
    this.#showViews(state);
    this.#background.value = hex(state.background);
    this.#boxes.checked = state.has_boxes;
    this.#showBoxes(state);
    const { quality } = state;
    this.#neighbours.input.max = `${quality.most_neighbours}`;
    this.#neighbours.show(quality.neighbours);
    this.#scales.input.max = `${state.scales}`;
    this.#scales.show(quality.scales);
    this.#step.show(Math.log2(quality.step));
    this.#threshold.show(Math.log2(Math.max(quality.threshold, 2 ** -20)));
    this.#finest.show(Math.log2(quality.finest));
    this.#showFacts(state);
  }

  #showSpeed(state: State): void {
    const milliseconds = (value: number | null): string => (value === null ? "…" : `${value.toFixed(1)} ms`);
    const parts = [`picture ${milliseconds(state.milliseconds)}`];
    if (state.milliseconds_before !== null) parts.push(`before ${milliseconds(state.milliseconds_before)}`);
    if (state.rays_per_second !== null) parts.push(`${Math.round(1e-3 * state.rays_per_second)} thousand rays/s`);
    if (state.divisor !== null && state.divisor > state.quality.finest) parts.push(`shown at 1/${state.divisor}`);
    if (state.memory_bytes) {
      const [scene, work] = state.memory_bytes.map((bytes) => (bytes / 1e6).toFixed(0));
      parts.push(`device memory ${scene} + ${work} MB`);
    }
    if (state.device) parts.push(state.device);
    this.#speed.textContent = parts.join(" · ");
  }

  #showViews(state: State): void {
    if (this.#views.childElementCount === 0) {
      for (const view of state.views) {
        const input = element("input", { type: "radio", name: "view", value: view });
        input.addEventListener("change", () => this.#do((player) => player.set_view(view)));
        this.#views.append(element("label", { className: "choice" }, input, view));
      }
    }
    for (const input of this.#views.querySelectorAll("input")) input.checked = input.value === state.view;
  }

  #showBoxes(state: State): void {
    this.#boxesOf.hidden = !state.has_boxes;
    while (this.#boxesOf.childElementCount > state.boxes.length) this.#boxesOf.lastElementChild?.remove();
    while (this.#boxesOf.childElementCount < state.boxes.length) {
      const scale = this.#boxesOf.childElementCount;
      const input = element("input", { type: "checkbox" });
      input.addEventListener("change", () => this.#do((player) => player.set_boxes_of(scale, input.checked)));
      this.#boxesOf.append(element("label", {}, input, ` scale ${scale}`));
    }
    this.#boxesOf.querySelectorAll("input").forEach((input, scale) => (input.checked = state.boxes[scale] ?? false));
  }

  #showFacts(state: State): void {
    const text = JSON.stringify(state.facts);
    if (text === this.#factsShown) return;
    this.#factsShown = text;
    this.#facts.replaceChildren(
      ...state.facts.map(({ name, value }) =>
        element("div", {}, element("dt", { textContent: name }), element("dd", { textContent: value })),
      ),
    );
  }

  #setQuality(): void {
    const state = this.#state;
    if (!state) return;
    const { quality } = state;
    const value = (slider: Slider): number => slider.input.valueAsNumber;
    const neighbours = value(this.#neighbours);
    const scales = value(this.#scales);
    const threshold = 2 ** value(this.#threshold);
    // Where the slider stands at the scene's own, as near as it can, nothing is to change.
    const isOwn = Math.abs(Math.log2(threshold / Math.max(quality.own_threshold, 2 ** -20))) < 0.13;
    this.#do((player) =>
      player.set_quality(
        neighbours < quality.most_neighbours ? neighbours : undefined,
        scales < state.scales ? scales : undefined,
        2 ** value(this.#step),
        isOwn ? undefined : threshold,
        2 ** value(this.#finest),
      ),
    );
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
