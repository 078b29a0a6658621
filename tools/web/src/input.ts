// Pointer, wheel, fingers and keys on a canvas, handed on to the player.

import type { Player } from "./generated/strivec";

/** Pixels of scrolling that are a line of a wheel. */
const PIXELS_A_LINE = 40;
const LINES_A_PAGE = 20;
/** What an arrow key turns by, in parts of the canvas's height. */
const ARROW = 0.05;
const ARROWS: Record<string, [number, number]> = {
  ArrowLeft: [-ARROW, 0],
  ArrowRight: [ARROW, 0],
  ArrowUp: [0, -ARROW],
  ArrowDown: [0, ARROW],
};
const NEARER: Record<string, number> = { Equal: 1, NumpadAdd: 1, Minus: -1, NumpadSubtract: -1 };

export interface Listener {
  /** The player, once there is one. */
  player(): Player | undefined;
  /** Something may have changed. */
  wake(): void;
  /** A key asked for what the page has to do: help, panel, screenshot, paths. */
  act(action: string): void;
}

/** Listens on `canvas`, and to the keys that `host` gets. */
export function listen(canvas: HTMLCanvasElement, host: HTMLElement, listener: Listener): void {
  /** In parts of the canvas's height. */
  const at = (event: PointerEvent): [number, number] => {
    const box = canvas.getBoundingClientRect();
    return [(event.clientX - box.left) / box.height, (event.clientY - box.top) / box.height];
  };
  const on = <K extends keyof HTMLElementEventMap>(
    name: K,
    hear: (player: Player, event: HTMLElementEventMap[K]) => void,
    changesNothing = (_: HTMLElementEventMap[K]): boolean => false,
  ): void =>
    canvas.addEventListener(
      name,
      (event) => {
        const player = listener.player();
        if (!player) return;
        hear(player, event);
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
    // Controls have keys of their own: F types, Space presses, arrows choose.
    if (!player || event.altKey || (isPressed && event.composedPath()[0] !== canvas)) return;
    // What a browser does with Control is its own business, but for digits.
    const isModified = event.ctrlKey || event.metaKey || (event.shiftKey && event.code.startsWith("Digit"));
    if ((event.ctrlKey || event.metaKey) && !event.code.startsWith("Digit")) return;
    const [arrow, nearer] = [ARROWS[event.code], NEARER[event.code]];
    if (arrow && isPressed) player.turn(...arrow);
    else if (nearer && isPressed) player.wheel(nearer);
    else if (!event.repeat) {
      const action = player.key(event.code, isPressed, isModified);
      if (action) listener.act(action);
      else if (!/^(Key[WASDQE]|Shift)/.test(event.code)) return;
    }
    if (!event.code.startsWith("Shift")) event.preventDefault();
    listener.wake();
  };
  host.addEventListener("keydown", (event) => key(event, true));
  host.addEventListener("keyup", (event) => key(event, false));
}
