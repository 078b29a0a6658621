// What the library says of the player (`Player.state`), as a panel shows it.

export interface Quality {
  neighbours: number;
  most_neighbours: number;
  scales: number;
  step: number;
  threshold: number;
  own_threshold: number;
  finest: number;
}

export interface State {
  facts: { name: string; value: string }[];
  scales: number;
  all_scales: number;
  is_whole: boolean;
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
  has_own_background: boolean;
  has_boxes: boolean;
  boxes: boolean[];
  quality: Quality;
}
