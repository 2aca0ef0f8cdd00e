// What the page is told (replay/page.py writes it), and how it is unpacked. Metres, seconds, radians.

export interface Parts {
  kind: number[];
  surface: number[];
  indoors: number[];
  place: number[];
  turn: number[];
  size: number[];
}

export interface Surface {
  name: string;
  emission: number;
  specular: number;
  shininess: number;
  picture?: string;
  repeat?: number;
}

export type Triple = [number, number, number];

export interface Lights {
  ambient: Triple;
  head: [Triple, Triple];
  lamps: [Triple, Triple, Triple][];
}

export interface Packed {
  number: number;
  epoch: number | null;
  who: string[];
  position: string;
  facing: string;
  pose: string;
  sensed: string;
  shoulder: string;
  beside: string;
  /** 1, 0, a severity between them, or null where an issue does not apply. */
  issues: (number | null)[];
  times: (number | null)[];
  outcome: string;
  shape: number[];
  coat: number[];
}

export interface Payload {
  grid: number;
  turn_grid: number;
  nothing: number;
  interval: number;
  timestep: number;
  most_steps: number;
  limits: { nearest: number; farthest: number; risk: number };
  issues: string[];
  identities: Record<string, string[]>;
  scene: {
    kinds: string[];
    surfaces: Surface[];
    room: Parts & { colour: string[] };
    robot: Parts & { colour: string[] };
    lights: Lights;
    fovy: Record<string, number>;
    room_size: Triple;
    /** Place and turn of the camera that shows the room. */
    room_view: number[];
  };
  figures: Parts[];
  coats: number[][];
  colours: string[];
  services: Packed[];
}

/** One service, unpacked. Arrays have a value for each pose, one `tick` apart. */
export interface Service {
  packed: Packed;
  frames: number;
  seconds: number;
  x: Float64Array;
  y: Float64Array;
  yaw: Float64Array;
  distance: Float64Array;
  /** NaN where there was no decision. */
  sensed: Float64Array;
  guests: { x: number; y: number; facing: number }[];
  shoulder: Float64Array;
  beside: Float64Array;
}

export function numbers(text: string): Int16Array {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Int16Array(bytes.buffer);
}

function views(data: Payload, text: string): Float64Array {
  return Float64Array.from(numbers(text), (v, i) => v / (i % 7 < 3 ? data.grid : data.turn_grid));
}

export function unpack(data: Payload, packed: Packed): Service {
  const metres = (text: string) =>
    Float64Array.from(numbers(text), (v) => (v === data.nothing ? NaN : v / data.grid));
  const pose = metres(packed.pose);
  const frames = pose.length / 3;
  const place = metres(packed.position);
  const guests = [...metres(packed.facing)].map((facing, i) => ({
    x: place[2 * i] ?? 0,
    y: place[2 * i + 1] ?? 0,
    facing,
  }));
  const column = (k: number) => Float64Array.from({ length: frames }, (_, i) => pose[3 * i + k] ?? 0);
  const x = column(0);
  const y = column(1);
  const yaw = column(2);
  for (let i = 1; i < frames; i++) {
    // packed within a turn: go the short way round
    const jump = yaw[i]! - yaw[i - 1]!;
    yaw[i] = yaw[i - 1]! + jump - 2 * Math.PI * Math.round(jump / (2 * Math.PI));
  }
  const asking = guests[0]!;
  return {
    packed,
    frames,
    seconds: (frames - 1) * data.interval * data.timestep,
    x,
    y,
    yaw,
    distance: x.map((value, i) => Math.hypot(value - asking.x, y[i]! - asking.y)),
    sensed: metres(packed.sensed),
    guests,
    shoulder: views(data, packed.shoulder),
    beside: views(data, packed.beside),
  };
}

/** The value at a time between two poses. */
export function at(values: Float64Array, position: number): number {
  const k = Math.max(0, Math.min(Math.floor(position), values.length - 1));
  const next = Math.min(k + 1, values.length - 1);
  return values[k]! + (values[next]! - values[k]!) * Math.max(0, Math.min(position - k, 1));
}

/** What was sensed last, NaN before the first reading. */
export function last(values: Float64Array, position: number): number {
  for (let k = Math.min(Math.floor(position + 1e-6), values.length - 1); k >= 0; k--) {
    if (!Number.isNaN(values[k]!)) return values[k]!;
  }
  return NaN;
}

export const ZONES = ["far", "proper", "too near", "risky"] as const;

/** Index into ZONES. */
export function zone(limits: Payload["limits"], distance: number): number {
  if (distance < limits.risk) return 3;
  if (distance < limits.nearest) return 2;
  return distance <= limits.farthest ? 1 : 0;
}

export function read(): Payload {
  return JSON.parse(document.getElementById("replay-data")!.textContent!) as Payload;
}

export function byId<T extends Element = HTMLElement>(id: string): T {
  return document.getElementById(id) as unknown as T;
}
