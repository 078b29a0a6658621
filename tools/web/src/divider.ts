// What two scenes are divided by: a line that is dragged, or moved by arrow keys.

import { element } from "./dom";

/** What an arrow key moves it by, in parts of the width. */
const STEP = 0.02;
const KEYS: Record<string, (at: number) => number> = {
  ArrowLeft: (at) => at - STEP,
  ArrowDown: (at) => at - STEP,
  ArrowRight: (at) => at + STEP,
  ArrowUp: (at) => at + STEP,
  Home: () => 0,
  End: () => 1,
};

export class Divider {
  readonly root = element("div", { id: "divider", tabIndex: 0, hidden: true });
  #at = 0.5;

  /** Calls `move` with the part of the width where the line is to be. */
  constructor(move: (at: number) => void) {
    const { root } = this;
    const to = (at: number): void => {
      this.show(Math.min(Math.max(at, 0), 1));
      move(this.#at);
    };
    root.setAttribute("role", "slider");
    root.setAttribute("aria-label", "Divider between the two scenes");
    root.setAttribute("aria-valuemin", "0");
    root.setAttribute("aria-valuemax", "100");
    root.addEventListener("pointerdown", (event) => {
      root.setPointerCapture(event.pointerId);
      root.focus();
      event.preventDefault();
    });
    root.addEventListener("pointermove", (event) => {
      const box = root.parentElement?.getBoundingClientRect();
      if (box && root.hasPointerCapture(event.pointerId)) to((event.clientX - box.left) / box.width);
    });
    root.addEventListener("keydown", (event) => {
      const moved = KEYS[event.key]?.(this.#at);
      if (moved === undefined || event.altKey || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      to(moved);
    });
  }

  /** Shows it there; hides it where there is nothing to divide. */
  show(at: number | null): void {
    this.root.hidden = at === null;
    if (at === null) return;
    this.#at = at;
    this.root.style.left = `${100 * at}%`;
    this.root.setAttribute("aria-valuenow", `${Math.round(100 * at)}`);
  }
}
