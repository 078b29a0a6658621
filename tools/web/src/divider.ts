// The divider of two scenes: a line that is moved by dragging or by arrow keys.

import { element } from "./dom";

/** Step of an arrow key, in parts of the width. */
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

  /** Calls `move` with the new position of the line, in parts of the width. */
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

  /** Shows the line at `at`; hides it if `at` is null. */
  show(at: number | null): void {
    this.root.hidden = at === null;
    if (at === null) return;
    this.#at = at;
    this.root.style.left = `${100 * at}%`;
    this.root.setAttribute("aria-valuenow", `${Math.round(100 * at)}`);
  }
}
