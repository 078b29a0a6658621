// What the library says of the player (`Player.state`), as a panel shows it.

export interface Quality {
  neighbors: number;
  most_neighbors: number;
  scales: number;
  step: number;
  threshold: number;
  own_threshold: number;
  finest: number;
}

export interface Opened {
  facts: { name: string; value: string }[];
  scales: number;
  all_scales: number;
  is_whole: boolean;
}

export interface State extends Opened {
  /** What the scene is compared with. */
  second: Opened | null;
  /** Left of this part of the width the first is seen, right of it the second; nothing where they are side by side. */
  divider: number | null;
  is_at_rest: boolean;
  device: string;
  memory_bytes: [number, number] | null;
  milliseconds: number | null;
  milliseconds_before: number | null;
  rays_per_second: number | null;
  divisor: number | null;
  view: string;
  views: string[];
  background: [number, number, number];
  own_background: [number, number, number];
  has_own_background: boolean;
  has_boxes: boolean;
  boxes: boolean[];
  /** What the file names: ways to draw for `Player.choose`. */
  choices: string[];
  /** How many training cameras the file holds, and which one was gone to. */
  cameras: number;
  camera: number | null;
  /** How much is to be seen of its photograph, and whether that is there. */
  photograph: number;
  has_photograph: boolean;
  is_recording: boolean;
  is_playing: boolean;
  quality: Quality;
}
