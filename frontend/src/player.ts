// Time: which service is shown, at what moment, and how fast it goes on.

import { type Payload, type Service, unpack } from "./data";

export const SPEEDS = [0.25, 0.5, 1, 2, 4];

export class Player {
  row = 0;
  service: Service;
  playing = false;
  speed = 1;
  /** Counted in poses, with fractions. */
  position = 0;
  private before = 0;

  constructor(
    readonly data: Payload,
    private readonly moved: () => void,
    private readonly changed: () => void,
    private readonly ended: () => void,
  ) {
    this.service = unpack(data, data.services[0]!);
  }

  get end(): number {
    return this.service.frames - 1;
  }

  /** Seconds between two poses. */
  get tick(): number {
    return this.data.interval * this.data.timestep;
  }

  /** Show another service from its beginning; `go` plays it. */
  choose(row: number, go: boolean): void {
    this.row = row;
    this.service = unpack(this.data, this.data.services[row]!);
    this.position = 0;
    this.play(go);
  }

  play(go: boolean): void {
    if (go && this.position >= this.end) this.position = 0;
    const starts = go && !this.playing;
    this.playing = go;
    this.changed();
    this.moved();
    if (starts) {
      this.before = performance.now();
      requestAnimationFrame((now) => this.advance(now));
    }
  }

  seek(position: number): void {
    this.position = Math.max(0, Math.min(position, this.end));
    this.moved();
  }

  private advance(now: number): void {
    if (!this.playing) return;
    // a page that was hidden goes on where it was
    const passed = Math.min(Math.max(now - this.before, 0), 250) / 1000;
    this.before = now;
    this.seek(this.position + (passed * this.speed) / this.tick);
    if (this.position >= this.end) {
      this.playing = false;
      this.changed();
      this.ended();
    } else requestAnimationFrame((next) => this.advance(next));
  }
}
