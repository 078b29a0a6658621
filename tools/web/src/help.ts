// What keys and the pointer do.

import { element } from "./dom";

const KEYS: [string, string][] = [
  ["left drag, one finger", "turn around the scene"],
  ["right drag, Shift + drag, two fingers", "move"],
  ["Ctrl + drag", "look around"],
  ["wheel, pinch", "nearer, farther"],
  ["W A S D Q E", "fly; with Shift faster"],
  ["arrow keys, + and −", "turn around the scene; nearer, farther"],
  ["F", "turn around what is under the pointer"],
  ["R", "back to the first view"],
  ["1 … 9", "go to a view that was kept; with Ctrl or Shift keep it"],
  ["V", "color, depth, opacity, normals, samples"],
  ["B", "tensor boxes"],
  ["P", "screenshot"],
  ["C, Space", "record a path, play it"],
  ["Page Down, Page Up", "the next training camera, the one before"],
  ["I", "the panel"],
  ["H, Escape", "this help, close it"],
  ["drop a file", "open it, a scene or a path; with Ctrl compare with it"],
  ["drop a dataset's folder", "its photographs"],
];

/** The help, closed. */
export function help(): HTMLDialogElement {
  const close = element("button", { type: "button", textContent: "Close", className: "close" });
  const rows = KEYS.map(([keys, what]) =>
    element("tr", {}, element("th", { scope: "row", textContent: keys }), element("td", { textContent: what })),
  );
  const title = element("h2", { id: "help-title", textContent: "Keys and pointer" });
  const dialog = element("dialog", { id: "help" }, title, element("table", {}, ...rows), close);
  dialog.setAttribute("aria-labelledby", "help-title");
  close.addEventListener("click", () => dialog.close());
  // H and F1 close what they opened; Escape does so by itself.
  dialog.addEventListener("keydown", (event) => {
    if (event.code === "KeyH" || event.code === "F1") {
      event.preventDefault();
      dialog.close();
    }
    event.stopPropagation();
  });
  return dialog;
}
