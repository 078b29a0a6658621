// The help of keys and pointer.

import { element } from "./dom";

/** The help, closed. */
export class Help {
  readonly root: HTMLDialogElement;
  readonly #table = element("table");

  constructor() {
    const close = element("button", { type: "button", textContent: "Close", className: "close" });
    const title = element("h2", { id: "help-title", textContent: "Keys and pointer" });
    const root = (this.root = element("dialog", { id: "help" }, title, this.#table, close));
    root.setAttribute("aria-labelledby", "help-title");
    close.addEventListener("click", () => root.close());
    // H and F1 close what they opened; the browser closes dialogs on Escape.
    root.addEventListener("keydown", (event) => {
      if (event.code === "KeyH" || event.code === "F1") {
        event.preventDefault();
        root.close();
      }
      event.stopPropagation();
    });
  }

  /** Sets the rows, pairs of input and effect: the library's `keys()`, as in the desktop player. */
  fill(keys: [string, string][]): void {
    this.#table.replaceChildren(
      ...keys.map(([input, effect]) =>
        element("tr", {}, element("th", { scope: "row", textContent: input }), element("td", { textContent: effect })),
      ),
    );
  }
}
