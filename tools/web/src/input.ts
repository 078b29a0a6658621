// Passes pointer, wheel, fingers and keys on a canvas to the player.

import type { Player } from "./generated/strivec";

/** Pixels of scrolling per line of a wheel. */
const PIXELS_A_LINE = 40;
const LINES_A_PAGE = 20;
/** Keys that orbit or zoom by a step, and repeat. */
const STEPS = /^(Arrow\w+|Equal|Minus|Numpad(Add|Subtract))$/;

export interface Listener {
  /** The player, once there is one. */
  player(): Player | undefined;
  /** Something may have changed. */
  wake(): void;
  /** Does an action of the page: help, panel, screenshot, paths. */
  act(action: string): void;
}

/** Listens to events of `canvas`, and to keys of `host`. */
export function listen(canvas: HTMLCanvasElement, host: HTMLElement, listener: Listener): void {
  /** In parts of the canvas's height. */
  const at = (event: PointerEvent): [number, number] => {
    const box = canvas.getBoundingClientRect();
    return [(event.clientX - box.left) / box.height, (event.clientY - box.top) / box.height];
  };
  const on = <K extends keyof HTMLElementEventMap>(
    name: K,
    handle: (player: Player, event: HTMLElementEventMap[K]) => void,
    changesNothing = (_: HTMLElementEventMap[K]): boolean => false,
  ): void =>
    canvas.addEventListener(
      name,
      (event) => {
        const player = listener.player();
        if (!player) return;
        handle(player, event);
        if (!changesNothing(event)) listener.wake();
      },
      { passive: false },
    );

  on("pointerdown", (player, event) => {
    canvas.setPointerCapture(event.pointerId);
    canvas.focus();
    event.preventDefault();
    if (event.pointerType === "touch") {
      player.touch(event.pointerId, ...at(event));
    } else {
      player.point(...at(event));
      player.press(event.button, event.ctrlKey || event.metaKey, event.shiftKey);
    }
  });
  const move = (player: Player, event: PointerEvent): void => {
    if (event.pointerType !== "touch") player.point(...at(event));
    else if (canvas.hasPointerCapture(event.pointerId)) player.touch(event.pointerId, ...at(event));
  };
  on("pointermove", move, (event) => event.buttons === 0);
  const end = (player: Player, event: PointerEvent): void => {
    if (event.pointerType === "touch") player.lift(event.pointerId);
    else player.release();
  };
  on("pointerup", end);
  on("pointercancel", end);
  on("lostpointercapture", end);
  on("contextmenu", (_, event) => event.preventDefault());
  on("wheel", (player, event) => {
    event.preventDefault();
    const unit = [1 / PIXELS_A_LINE, 1, LINES_A_PAGE][event.deltaMode] ?? 1;
    player.wheel(-event.deltaY * unit);
  });
  on("blur", (player) => player.release_keys());

  const key = (event: KeyboardEvent, isPressed: boolean): void => {
    const player = listener.player();
    // Controls use keys themselves: F types, Space presses, arrows choose.
    if (!player || event.altKey || (isPressed && event.composedPath()[0] !== canvas)) return;
    // The browser keeps its shortcuts with Control, except for digits.
    const isModified = event.ctrlKey || event.metaKey || (event.shiftKey && event.code.startsWith("Digit"));
    if ((event.ctrlKey || event.metaKey) && !event.code.startsWith("Digit")) return;
    const steps = STEPS.test(event.code);
    if (steps || !event.repeat) {
      const action = player.key(event.code, isPressed, isModified);
      if (action) listener.act(action);
      else if (!steps && !/^(Key[WASDQE]|Shift)/.test(event.code)) return;
    }
    if (!event.code.startsWith("Shift")) event.preventDefault();
    listener.wake();
  };
  host.addEventListener("keydown", (event) => key(event, true));
  host.addEventListener("keyup", (event) => key(event, false));
}
