// All clips of a page, seen one after another.

import { Clip } from "./clip";
import { el } from "./dom";
import type { Page } from "./types";

let inPicture = false;

export class Clips {
  readonly element = el("div", { class: "clips" });
  readonly views: Record<string, number>;
  private readonly all: Clip[] = [];

  /** Calls `changed` after every full view. */
  constructor(
    page: Page,
    views: Record<string, number>,
    rate: number,
    private readonly changed: () => void,
  ) {
    this.views = { ...views };
    const groups = page.clips
      ? [{ title: "", clips: page.clips, captions: page.captions ?? [] }]
      : [
          { title: "First robot", ...page.first! },
          { title: "Second robot", ...page.second! },
        ];
    for (const { title, clips, captions } of groups) {
      const grid = el("div", { class: "clip-grid" });
      clips.forEach((name, k) => {
        const number = clips.length > 1 ? `Clip ${k + 1} of ${clips.length}` : "Clip";
        const words = title ? `${title}: ${number.toLowerCase()}` : number;
        const clip = new Clip(name, words, captions[k] ?? "", this.views[name] ?? 0, rate, {
          seen: (seen) => this.saw(seen),
          plays: (one) => this.all.forEach((other) => other !== one && other.pause()),
        });
        this.all.push(clip);
        grid.append(clip.element);
      });
      if (title) this.element.append(el("h2", {}, title));
      this.element.append(grid);
    }
    if (groups.some((group) => group.captions.some((caption) => caption))) this.offerCaptions();
    this.unlock();
  }

  get done(): boolean {
    return this.all.every((clip) => clip.done);
  }

  get count(): number {
    return this.all.length;
  }

  stop(): void {
    for (const clip of this.all) clip.pause();
  }

  /** Plays what was not seen yet, one after another: how simulated participants watch. */
  async watch(): Promise<void> {
    for (const clip of this.all) {
      clip.video.muted = true; // without a press of a key, browsers play nothing that can be heard
      // again where a busy machine made a clip in a hurry jump, which is no view
      while (!clip.done) {
        const ended = new Promise((resolve) => {
          clip.video.addEventListener("ended", resolve, { once: true });
        });
        clip.toggle();
        await ended;
      }
    }
  }

  private saw(name: string): void {
    this.views[name] = (this.views[name] ?? 0) + 1;
    this.unlock();
    this.changed();
  }

  private unlock(): void {
    const next = this.all.findIndex((clip) => !clip.done);
    this.all.forEach((clip, k) => {
      clip.locked = next >= 0 && k > next;
    });
  }

  private offerCaptions(): void {
    const box = el("input", { type: "checkbox", id: "captions" });
    const show = () => this.all.forEach((clip) => (clip.captioned = inPicture));
    box.checked = inPicture;
    box.addEventListener("change", () => {
      inPicture = box.checked;
      show();
    });
    show();
    const words = "Show the text below each clip in the picture, too";
    this.element.append(el("label", { class: "option alone", for: "captions" }, box, words));
  }
}
