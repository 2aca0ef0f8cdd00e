// One clip. It has to be seen to its end once; then it can be seen again as often as one likes.
//
// There are no controls of the browser's: they would let people skip. Skipping is undone in whatever
// way it comes about, because the clip only counts as far as it was played in real time.

import { button, el, inItsLanguage } from "./dom";

/** How much faster than the clock a clip may go on before that is a skip: clocks differ a little. */
const SLACK = 1.25;
const JUMP = 0.4;

export interface Watched {
  /** Called at each full view. */
  seen(name: string): void;
  /** Called when a clip begins to play: the others stop. */
  plays(clip: Clip): void;
}

export class Clip {
  readonly element: HTMLElement;
  readonly video: HTMLVideoElement;
  private readonly control: HTMLButtonElement;
  private readonly state = el("p", { class: "clip-state" });
  private readonly bar: HTMLProgressElement;
  private readonly live = el("p", { class: "unseen", role: "status" });
  private readonly track: HTMLTrackElement | null;
  /** Seconds that were played without a skip, and when that was measured. */
  private reached = 0;
  private measured = 0;
  private pressed = false;
  private failed = false;

  constructor(
    readonly name: string,
    readonly title: string,
    caption: string,
    private views: number,
    private readonly rate: number,
    private readonly watched: Watched,
  ) {
    this.video = el("video", {
      src: `/clips/${encodeURIComponent(name)}`,
      preload: "auto",
      playsinline: true,
      disablepictureinpicture: true,
      disableremoteplayback: true,
      "aria-label": caption ? `${title}. ${caption}` : title,
    });
    this.track = caption ? captions(caption) : null;
    if (this.track) this.video.append(this.track);
    this.bar = el("progress", { max: "1", value: "0", "aria-label": `${title}, played so far` });
    this.control = button("Play", () => this.toggle(), "clip-play");
    this.video.addEventListener("click", () => {
      if (!this.control.disabled) this.toggle();
    });
    // its entries would loop the clip, so that it never ends
    this.video.addEventListener("contextmenu", (event) => event.preventDefault());
    this.element = el(
      "figure",
      { class: "clip" },
      el("p", { class: "clip-title" }, title),
      this.video,
      this.bar,
      el("div", { class: "row" }, this.control, this.state),
      caption ? inItsLanguage(el("figcaption", {}, caption)) : null,
      this.live,
    );
    this.listen();
    this.show();
  }

  get done(): boolean {
    return this.views > 0;
  }

  /** A clip that has its turn later cannot be played yet. */
  set locked(value: boolean) {
    this.control.disabled = value;
    this.show();
  }

  set captioned(value: boolean) {
    if (this.track) this.track.track.mode = value ? "showing" : "hidden";
  }

  pause(): void {
    this.video.pause();
  }

  toggle(): void {
    if (this.failed) {
      this.failed = false;
      this.live.textContent = "";
      this.reached = 0;
      this.video.load();
    }
    if (!this.video.paused) {
      this.video.pause();
      return;
    }
    if (this.video.ended) this.reached = 0;
    this.video.playbackRate = this.rate;
    // from here, as events of a busy page come late, when the clip has long been playing
    this.measured = performance.now();
    this.pressed = true;
    this.video.play().catch((error: unknown) => {
      // a pause that came while it was loading is no failure
      if (!(error instanceof DOMException && error.name === "AbortError")) this.fail();
    });
  }

  private listen(): void {
    const on = (name: string, act: () => void) => this.video.addEventListener(name, act);
    on("play", () => {
      if (!this.pressed) this.measured = performance.now(); // by the keys of a keyboard for media
      this.pressed = false;
      this.watched.plays(this);
      this.show();
    });
    on("pause", () => this.show());
    on("waiting", () => this.show("Loading\u2026"));
    on("playing", () => this.show());
    on("timeupdate", () => this.measure());
    on("seeking", () => this.measure());
    on("ratechange", () => {
      if (!this.done && this.video.playbackRate > this.rate) this.video.playbackRate = this.rate;
    });
    on("loadedmetadata", () => this.show());
    on("error", () => this.fail());
    on("ended", () => this.end());
    window.addEventListener("online", () => {
      if (this.failed && this.element.isConnected) this.video.load();
    });
    on("canplay", () => {
      if (this.failed) this.live.textContent = "";
      this.failed = false;
      this.show();
    });
  }

  /** Takes in what was played since the last time, and takes back what was skipped. */
  private measure(): void {
    const now = performance.now();
    const passed = ((now - this.measured) / 1000) * this.rate;
    const gone = this.video.currentTime - this.reached;
    if (gone > passed * SLACK + JUMP && !this.done) {
      this.video.currentTime = this.reached;
    } else if (gone > 0 || this.done) {
      this.reached = this.video.currentTime;
    }
    this.measured = now;
    this.bar.value = this.video.duration ? this.video.currentTime / this.video.duration : 0;
    this.show();
  }

  private end(): void {
    this.measure();
    const whole = this.reached >= this.video.duration - JUMP;
    if (!whole && !this.done) return;
    this.views += 1;
    this.show();
    this.live.textContent = `${this.title} was played to its end.`;
    this.watched.seen(this.name);
  }

  private fail(): void {
    this.failed = true;
    this.show();
    this.live.textContent = this.state.textContent;
  }

  private show(now = ""): void {
    const { paused, ended, currentTime, duration } = this.video;
    const label = !paused ? "Pause" : ended || (this.done && !currentTime) ? "Watch again" : "Play";
    this.control.textContent = this.failed ? "Try again" : label;
    this.control.setAttribute("aria-label", `${this.control.textContent}: ${this.title}`);
    this.element.dataset.seen = this.done ? "yes" : "no";
    const times = duration ? ` ${seconds(currentTime)} of ${seconds(duration)}.` : "";
    this.state.textContent = this.failed
      ? "This clip cannot be loaded just now. Nothing is lost: check your connection and try again."
      : this.control.disabled
        ? "Comes next."
        : now || (this.done ? `\u2713 Watched.${times}` : `Not seen to its end yet.${times}`);
  }
}

function seconds(value: number): string {
  const whole = Math.floor(value);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

/** The caption as a track, so that it can be shown in the picture as captions are. */
function captions(text: string): HTMLTrackElement {
  const safe = text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
  const cue = safe.replace(/\s*\n\s*/g, " ");
  // at the top: clips of services say at the bottom how they ended
  const file = new Blob([`WEBVTT\n\n00:00.000 --> 99:59:59.000 line:0\n${cue}\n`], { type: "text/vtt" });
  return el("track", { kind: "captions", label: "Captions", src: URL.createObjectURL(file) });
}
