// What each view looks like, and when it is done.

import { Clips } from "./clips";
import { button, el, inItsLanguage, paragraphs } from "./dom";
import { Fields, type Lack } from "./fields";
import type { Draft } from "./memory";
import type { Page, Simulated, View } from "./types";
import type { Walk } from "./walk";
import { heading, introduction, NEXT, stop } from "./words";

/** Clips of simulated participants: the fastest that browsers play. */
const HURRY = 16;
/** Seconds until a participant is sent back to where she came from; WCAG 2.2.1 asks for 20. */
const STAY = 30;

export interface Shown {
  title: string;
  nodes: Node[];
  /** Does what a simulated participant would do; without an answer she leaves. */
  simulate?(answer: Simulated | undefined): Promise<void>;
  /** Called when the view is taken away. */
  gone?(): void;
}

export function show(view: View, walk: Walk): Shown {
  switch (view.kind) {
    case "consent":
      return consent(walk);
    case "page":
      return asked(view.page, view.problem, walk);
    case "saving":
      return saving();
    case "finished":
      return finished(view, walk);
    case "stop":
      return stopped(view, walk);
  }
}

function consent(walk: Walk): Shown {
  const { study } = walk;
  const not = study.shared_computer ? "leave this page as it is" : "close this page";
  const agree = button("I agree: begin", () => {
    if (agree.getAttribute("aria-disabled")) return;
    agree.setAttribute("aria-disabled", "true");
    agree.textContent = "Beginning\u2026";
    void walk.begin();
  }, "main");
  return {
    title: study.title,
    nodes: [
      el("p", { class: "lead" }, `This takes about ${study.minutes} minutes. You can stop at any time.`),
      paragraphs(study.consent.text),
      el("p", { class: "hint" }, `If you do not agree, ${not}. Nothing is sent to the study then.`),
      el("div", { class: "row" }, agree),
    ],
    simulate: async () => agree.click(),
  };
}

function asked(page: Page, problem: string, walk: Walk): Shown {
  const before: Draft = walk.draft(page);
  const since = performance.now(); // not the clock of the day, which can jump
  const draft = (): Draft => ({
    values: fields.values,
    views: clips ? clips.views : {},
    shown_ms: before.shown_ms + performance.now() - since,
  });
  const keep = () => {
    if (!done) walk.keep(page, draft());
  };
  let done = false;
  let told: Simulated | undefined;
  const fields = new Fields(page.questions ?? [], keep);
  fields.fill(before.values);
  const filmed = page.kind === "set" || page.kind === "pair";
  const rate = window.evenhandSimulated ? HURRY : 1;
  const live = el("p", { class: "unseen", role: "status" });
  const clips = filmed
    ? new Clips(page, before.views, rate, () => {
        keep();
        open();
      })
    : null;
  const summary = el("div", { class: "summary", tabindex: "-1", "aria-labelledby": "summary-title", hidden: true });
  const form = el(
    "form",
    { novalidate: true, autocomplete: "off" },
    filmed ? el("h2", {}, "Your view") : null,
    fields.element,
    el("div", { class: "row" }, el("button", { type: "submit", class: "main" }, "Save and go on")),
  );
  const wait = el("p", { class: "wait" }, waiting(clips?.count ?? 0));
  const open = () => {
    const ready = !clips || clips.done;
    if (ready && form.hidden) live.textContent = "The questions are below the clips now.";
    form.hidden = !ready;
    wait.hidden = ready;
  };
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    if (done) return;
    const lacks = fields.check();
    if (lacks.length) {
      summarise(summary, lacks);
      return;
    }
    done = true;
    clips?.stop();
    const answer = draft();
    walk.submit(page, told ? { ...answer, shown_ms: told.shown_ms } : answer);
  });
  if (problem) refused(summary, problem);
  // hidden from the beginning, so that nothing is announced that was there
  form.hidden = !!clips && !clips.done;
  open();
  const hidden = () => document.hidden && keep();
  document.addEventListener("visibilitychange", hidden);
  window.addEventListener("pagehide", keep);
  const words = introduction(page);
  return {
    title: heading(page, walk),
    nodes: [
      summary,
      ...(words ? [el("p", { class: "lead" }, words)] : []),
      ...(clips ? [clips.element, wait, live] : []),
      form,
    ],
    async simulate(answer) {
      if (!answer) {
        while (!walk.allSaved) await new Promise((resolve) => setTimeout(resolve, 50));
        document.documentElement.dataset.simulated = "left";
        return;
      }
      told = answer;
      await clips?.watch();
      fields.fill(answer.values);
      form.requestSubmit();
    },
    gone() {
      keep();
      done = true;
      clips?.stop();
      document.removeEventListener("visibilitychange", hidden);
      window.removeEventListener("pagehide", keep);
    },
  };
}

function waiting(clips: number): string {
  const all = clips === 1 ? "the clip" : clips === 2 ? "both clips" : `all ${clips} clips`;
  return `The questions come here as soon as you have watched ${all} to the end.`;
}

function summarise(summary: HTMLElement, lacks: Lack[]): void {
  const items = lacks.map(({ question, sentence, field }) => {
    const asked = inItsLanguage(el("span", {}, question.ask));
    const link = el("a", { href: `#${field.id}` }, sentence.replace(".", ": "), asked);
    link.addEventListener("click", (event) => {
      event.preventDefault();
      field.focus();
      field.scrollIntoView({ block: "center" });
    });
    return el("li", {}, link);
  });
  const title = lacks.length === 1 ? "Please look at one answer again" : `Please look at ${lacks.length} answers again`;
  summary.replaceChildren(el("h2", { id: "summary-title" }, title), el("ul", {}, ...items));
  summary.hidden = false;
  summary.focus();
  summary.scrollIntoView({ block: "start" });
}

function refused(summary: HTMLElement, sentence: string): void {
  summary.replaceChildren(
    el("h2", { id: "summary-title" }, "This page could not be saved"),
    el("p", {}, `The study says: ${sentence}`),
    el("p", {}, "Your answers are still here: please change them, and save again."),
  );
  summary.hidden = false;
}

function saving(): Shown {
  return {
    title: "Saving your last answers",
    nodes: [
      el("p", { class: "lead" }, "You have answered everything. Please leave this page open until all of it is saved."),
    ],
  };
}

function finished(view: Extract<View, { kind: "finished" }>, walk: Walk): Shown {
  const { study } = walk;
  const { code, redirect } = view.ending;
  const nodes: Node[] = [
    el("p", { class: "lead" }, "\u2713 You have finished, and everything is saved."),
    paragraphs(view.page.thanks ?? ""),
  ];
  if (code) {
    nodes.push(el("p", { class: "code" }, "Your completion code: ", el("strong", { id: "code" }, code)));
  }
  let timer = 0;
  const back = target(redirect);
  if (back && study.preview) {
    nodes.push(el("p", { class: "hint" }, `Participants are sent on from here to: ${back.href}`));
  } else if (back && !window.evenhandSimulated) {
    nodes.push(el("div", { class: "row" }, el("a", { class: "button main", href: back.href, id: "back" }, `Go back to ${back.hostname}`)));
    if (view.fresh) {
      const line = el("p", { class: "hint", id: "sent-on" }, `You are taken there in ${STAY} seconds. `);
      const stay = button("Stay on this page", () => {
        clearTimeout(timer);
        line.replaceChildren("You stay on this page.");
      }, "plain");
      line.append(stay);
      nodes.push(line);
      const leave = () => {
        timer = window.setTimeout(() => {
          // nobody is taken away while deciding whether to withdraw
          if (document.querySelector("dialog[open]")) leave();
          else location.assign(back.href);
        }, STAY * 1000);
      };
      leave();
    }
  }
  if (study.shared_computer) {
    nodes.push(
      el("p", { class: "hint" }, "If you want to download or delete your answers, do it before the next person begins."),
      el("div", { class: "row" }, button(NEXT, () => walk.leave(), "main")),
    );
  } else nodes.push(el("p", { class: "hint" }, back ? "" : "You can close this page."));
  if (window.evenhandSimulated) document.documentElement.dataset.simulated = "finished";
  return { title: "Thank you", nodes, gone: () => clearTimeout(timer) };
}

/** Where to go in the end; only by HTTPS, whatever was written down. */
function target(redirect: string): URL | null {
  if (!redirect) return null;
  try {
    const url = new URL(redirect);
    return url.protocol === "https:" ? url : null;
  } catch {
    return null;
  }
}

function stopped(view: Extract<View, { kind: "stop" }>, walk: Walk): Shown {
  const { title, text, again, anew } = stop(view.code, view.sentence, walk.study);
  if (window.evenhandSimulated) document.documentElement.dataset.stopped = view.sentence || title;
  const nodes: Node[] = text.filter((one) => one).map((one) => el("p", {}, one));
  if (again) {
    const act = () => {
      if (anew) walk.memory.anew();
      location.reload();
    };
    nodes.push(el("div", { class: "row" }, button(again, act, "main")));
  }
  return { title, nodes };
}
