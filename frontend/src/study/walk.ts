// Where a participant is, and what comes next. Knows nothing of how pages look.
//
// A page that is answered joins a queue, which lies in the browser's memory, and the next page is
// shown at once. The queue is emptied in order, one page at a time, with the same key for the same
// page however often it is sent. The server is the one who knows what is stored: whenever it says
// no, its state is asked for, and the participant goes on from there.

import { api, Later, Refusal } from "./api";
import { clock, type Draft, type Memory, uuid } from "./memory";
import type { Ending, Page, Saved, Simulated, State, Study, Values, View } from "./types";

const LONGEST_WAIT = 30;

export class Walk {
  /** Called when another view is to be shown than before. */
  moved: () => void = () => {};
  /** Called with how many pages wait to be saved. */
  told: (saved: Saved, waiting: number) => void = () => {};
  /** Called with what the participant should know, beside the page. */
  noticed: (sentence: string) => void = () => {};
  /** jsPsych's options by place, when the participant is simulated. */
  readonly simulation: Record<string, { data: Simulated }> = {};

  private pages: Page[] = [];
  private answered = new Set<string>();
  private ending: Ending | null = null;
  private fresh = false;
  private stopped: { code: string; sentence: string } | null = null;
  private readonly problems: Record<string, string> = {};
  private failures = 0;
  private saved: Saved = "nothing";
  private pumping = false;
  private wake: () => void = () => {};

  constructor(
    readonly study: Study,
    readonly memory: Memory,
  ) {
    window.addEventListener("online", () => this.hurry());
    memory.watch(() => this.stop("elsewhere", ""));
  }

  get begun(): boolean {
    return this.memory.notes.begun;
  }

  /** Whether there is nothing that only this browser knows. */
  get allSaved(): boolean {
    return this.memory.notes.queue.length === 0;
  }

  get view(): View {
    if (this.stopped) return { kind: "stop", ...this.stopped };
    if (!this.begun) return { kind: "consent" };
    const queued = new Set(this.memory.notes.queue.map((one) => one.page));
    const next = this.asking.find((page) => !this.answered.has(page.id) && !queued.has(page.id));
    if (next) return { kind: "page", page: next, problem: this.problems[next.id] ?? "" };
    const last = this.pages[this.pages.length - 1];
    if (!this.ending || !last) return { kind: "saving" };
    return { kind: "finished", page: last, ending: this.ending, fresh: this.fresh };
  }

  /** Differs when another view has to be shown. */
  get place(): string {
    const view = this.view;
    if (view.kind === "page") return `page ${view.page.id} ${view.problem}`.trim();
    return view.kind === "stop" ? `stop ${view.code}` : view.kind;
  }

  /** How many pages are behind, of how many; the consent is the first, the thanks no page. */
  get progress(): [number, number] {
    if (!this.begun) return [0, this.study.pages_total - 1];
    const view = this.view;
    const all = this.pages.length - 1;
    if (view.kind === "page") return [this.pages.indexOf(view.page), all];
    return [view.kind === "stop" ? this.answered.size : all, all];
  }

  /** Number of a page among those of its kind, and how many there are. */
  ordinal(page: Page): [number, number] {
    const alike = this.pages.filter((one) => one.kind === page.kind);
    return [alike.indexOf(page) + 1, alike.length];
  }

  draft(page: Page): Draft {
    return this.memory.notes.drafts[page.id] ?? { values: {}, views: {}, shown_ms: 0 };
  }

  keep(page: Page, draft: Draft): void {
    if (!this.begun) return; // withdrawn just now
    this.memory.notes.drafts[page.id] = draft;
    this.memory.save();
  }

  /** Goes on where this browser was. */
  async resume(): Promise<void> {
    if (!this.begun) return;
    await this.insist(async () => this.take(await api.state(this.memory.notes.token)));
    this.pump();
  }

  /** Agrees to the consent text. */
  async begin(): Promise<void> {
    const { notes } = this.memory;
    this.memory.save();
    await this.insist(async () => {
      const simulate = window.evenhandSimulated;
      const begun = await api.begin({
        consent_version: this.study.consent.version,
        token: notes.token,
        ...(Object.keys(notes.external).length ? { external: notes.external } : {}),
        ...(simulate ? { simulated: true } : {}),
      });
      for (const [page, data] of Object.entries((await simulate?.(begun.state.pages)) ?? {})) {
        this.simulation[`page ${page}`] = { data };
      }
      notes.begun = true;
      this.memory.save();
      this.take(begun.state);
    });
    this.pump();
  }

  /** A page is answered. */
  submit(page: Page, draft: Draft): void {
    const { notes } = this.memory;
    delete this.problems[page.id];
    delete notes.drafts[page.id];
    notes.queue.push({
      page: page.id,
      sent: {
        key: uuid(),
        sequence: notes.sequence++,
        values: draft.values,
        shown_ms: Math.round(draft.shown_ms),
        clip_views: draft.views,
        at: clock(),
      },
    });
    const place = new Map(this.pages.map((one, k) => [one.id, k]));
    notes.queue.sort((a, b) => (place.get(a.page) ?? 0) - (place.get(b.page) ?? 0));
    this.memory.save();
    this.moved();
    this.tell(this.saved);
    this.hurry();
    this.pump();
  }

  /** Tries again now. */
  hurry(): void {
    this.wake();
  }

  /** Withdraws; throws what went wrong. */
  async withdraw(): Promise<void> {
    await api.withdraw(this.memory.notes.token);
    this.memory.forget();
    this.stop("withdrawn", "");
  }

  /** Forgets this participant, so that the next one can begin. */
  leave(): void {
    this.memory.forget();
    location.reload();
  }

  stop(code: string, sentence: string): void {
    this.stopped = { code, sentence };
    this.moved();
  }

  private get asking(): Page[] {
    return this.pages.filter((page) => page.questions !== undefined);
  }

  private take(state: State): void {
    this.pages = state.pages;
    this.answered = new Set(Object.keys(state.answered));
    const { notes } = this.memory;
    // what was sent before the browser crashed, and stored, needs not be sent again
    notes.queue = notes.queue.filter((one) => !this.answered.has(one.page));
    this.memory.save();
  }

  /** What can be sent now: pages in order, then that everything is done. */
  private next(): (() => Promise<void>) | null {
    if (!this.begun || this.stopped || !this.memory.mine) return null;
    const { notes } = this.memory;
    const first = this.asking.find((page) => !this.answered.has(page.id));
    const head = notes.queue[0];
    if (head && (!first || head.page === first.id)) {
      return async () => {
        await api.save(notes.token, head.page, head.sent);
        this.answered.add(head.page);
        notes.queue = notes.queue.filter((one) => one !== head);
        this.memory.save();
      };
    }
    if (first || this.ending) return null;
    return async () => {
      const asked = await api.finish(notes.token);
      this.fresh = !notes.ended;
      this.ending = asked;
      notes.ended = true;
      this.memory.save();
    };
  }

  private async pump(): Promise<void> {
    if (this.pumping) return;
    this.pumping = true;
    for (let job = this.next(); job; job = this.next()) {
      this.tell("saving");
      await this.insist(job);
      this.moved();
    }
    this.pumping = false;
    this.moved();
    this.tell("saved");
  }

  /** Does a thing, again and again until the server answers, and minds what it refuses. */
  private async insist(job: () => Promise<void>): Promise<void> {
    for (;;) {
      try {
        await job();
        this.failures = 0;
        return;
      } catch (error) {
        if (error instanceof Refusal) {
          this.failures = 0;
          await this.heed(error);
          return;
        }
        if (!(error instanceof Later)) throw error;
        this.failures += 1;
        this.tell(error.offline ? "offline" : "busy");
        // apart from each other, so that not all come back in the same second
        const backoff = Math.min(LONGEST_WAIT, 2 ** (this.failures - 1)) * (0.5 + Math.random() / 2);
        await this.sleep(Math.max(backoff, Math.min(error.seconds, LONGEST_WAIT)));
        if (!this.memory.mine) return;
      }
    }
  }

  private sleep(seconds: number): Promise<void> {
    return new Promise((resolve) => {
      const timer = setTimeout(resolve, seconds * 1000);
      this.wake = () => {
        clearTimeout(timer);
        resolve();
      };
    });
  }

  /** The server refused. Nothing that was answered is thrown away unless it is stored already. */
  private async heed(refusal: Refusal): Promise<void> {
    const { notes } = this.memory;
    const head = notes.queue[0];
    switch (refusal.code) {
      case "withdrawn":
        this.memory.forget();
        return this.stop("withdrawn", refusal.message);
      case "key-reused":
        if (head) head.sent.key = uuid();
        return this.refresh();
      case "already-answered":
        await this.refresh();
        return this.noticed(
          "A page had been answered before, for instance in another window. The answers that were given there count.",
        );
      case "out-of-order":
      case "not-finished":
        return this.refresh();
      case "invalid":
      case "too-large":
        if (!head) break;
        // back to that page, with everything as it was typed
        this.problems[head.page] = refusal.message;
        notes.queue = notes.queue.filter((one) => one !== head);
        notes.drafts[head.page] = {
          values: head.sent.values as Values,
          views: head.sent.clip_views,
          shown_ms: head.sent.shown_ms,
        };
        this.memory.save();
        return this.moved();
    }
    this.stop(refusal.code, refusal.message);
  }

  private async refresh(): Promise<void> {
    await this.insist(async () => this.take(await api.state(this.memory.notes.token)));
  }

  private tell(saved: Saved): void {
    this.saved = saved;
    const waiting = this.memory.notes.queue.length;
    this.told(this.begun || saved === "offline" || saved === "busy" ? saved : "nothing", waiting);
  }
}
