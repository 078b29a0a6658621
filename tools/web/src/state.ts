// The state of the player (`Player.state`), as the panel shows it.

export interface Quality {
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
  /** The scene that it is compared with. */
  second: Opened | null;
  /** Divider of two scenes in parts of the width; null if they are side by side. */
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
  /** False if all scenes have a sky. */
  shows_background: boolean;
  has_boxes: boolean;
  boxes: boolean[];
  /** Quality settings stored in the file, for `Player.choose`. */
  choices: string[];
  /** Number of training cameras in the file, and the chosen one. */
  cameras: number;
  camera: number | null;
  /** Share of its photograph in the picture, and whether it is loaded. */
  photograph: number;
  has_photograph: boolean;
  /** Where rays begin, and the largest value to choose, in units of the dataset. */
  near: [number, number];
  is_recording: boolean;
  is_playing: boolean;
  quality: Quality;
}
