// What stands around every page: progress, whether answers are saved, and the participant's rights.

import { api, Later } from "./api";
import { button, byId, el } from "./dom";
import type { Saved } from "./types";
import type { Walk } from "./walk";

/** Milliseconds before it is worth saying that something is being saved. */
const BRIEF = 700;

export function frame(walk: Walk): { update(): void } {
  const { study } = walk;
  byId("study-title").textContent = study.title;
  byId("preview").hidden = !study.preview;
  byId("preview-anew").addEventListener("click", () => {
    walk.memory.forget();
    location.reload();
  });
  const contact = byId("contact");
  contact.textContent = study.contact ? `Questions about the study? Write to: ${study.contact}` : "";
  contact.hidden = !study.contact;
  byId("forgetful").hidden = walk.memory.lasting;
  byId("hurry").addEventListener("click", () => walk.hurry());
  rights(walk);
  nextPerson(walk);
  const notice = byId("notice");
  let noticed = ""; // where it was said: it stays for as long as that page
  walk.noticed = (sentence) => {
    notice.replaceChildren(el("p", { class: "notice" }, sentence));
    noticed = walk.place;
  };
  let timer = 0;
  walk.told = (saved, waiting) => {
    clearTimeout(timer);
    byId("saved").dataset.saved = saved; // at once; the words wait, so that they do not flicker
    if (saved === "saving") timer = window.setTimeout(() => say(walk, saved, waiting), BRIEF);
    else say(walk, saved, waiting);
  };
  return {
    update() {
      const view = walk.view;
      if (walk.place !== noticed) notice.replaceChildren();
      const [behind, all] = walk.progress;
      const over = view.kind === "finished" || view.kind === "stop";
      byId("progress").hidden = over;
      byId("study-title").hidden = view.kind === "consent"; // it is the heading there
      if (view.kind === "stop") say(walk, "nothing", 0);
      byId<HTMLProgressElement>("progress-bar").max = all;
      byId<HTMLProgressElement>("progress-bar").value = behind;
      const here = Math.min(behind + 1, all);
      byId("progress-words").textContent =
        view.kind === "saving" ? "All pages answered" : `Page ${here} of ${all}`;
      byId("next").hidden = !study.shared_computer || !walk.begun || over;
      byId("rights").hidden = !walk.begun || (view.kind === "stop" && view.code === "elsewhere");
    },
  };
}

function say(walk: Walk, saved: Saved, waiting: number): void {
  const pages = waiting === 1 ? "1 page waits" : `${waiting} pages wait`;
  const kept = walk.memory.safe
    ? "Your answers are kept in this browser, and you can go on."
    : "Please leave this page open. You can go on.";
  const words: Record<Saved, string> = {
    nothing: "",
    saved: walk.begun ? `\u2713 Everything so far is ${walk.study.preview ? "kept until the preview ends" : "saved"}.` : "",
    saving: "Saving\u2026",
    offline: waiting
      ? `Waiting for the connection: ${pages} to be saved. ${kept}`
      : "Waiting for the connection\u2026 This page tries again by itself.",
    busy: waiting
      ? `The study is busy: ${pages} to be saved. ${kept}`
      : "The study is busy\u2026 This page tries again by itself.",
  };
  const line = byId("saved");
  if (line.textContent !== words[saved]) line.textContent = words[saved];
  line.dataset.saved = saved;
  byId("hurry").hidden = saved !== "offline" && saved !== "busy";
}

function rights(walk: Walk): void {
  const dialog = byId<HTMLDialogElement>("withdrawing");
  const problem = byId("withdrawing-problem");
  const told = byId("rights-told");
  byId("withdraw").addEventListener("click", () => {
    problem.textContent = "";
    dialog.showModal();
  });
  byId("withdraw-not").addEventListener("click", () => dialog.close());
  byId("withdraw-yes").addEventListener("click", async () => {
    problem.textContent = "";
    try {
      await walk.withdraw();
      dialog.close();
    } catch (error) {
      problem.textContent = `Your answers are not deleted yet. ${why(error)}`;
    }
  });
  byId("download").addEventListener("click", async () => {
    told.textContent = "";
    try {
      const stored = await api.mine(walk.memory.notes.token);
      const { queue, drafts } = walk.memory.notes;
      // what only this browser knows is the participant's, too
      const all = { ...stored, not_saved_yet: { pages: queue, drafts } };
      save(JSON.stringify(all, null, 1), `${walk.study.name}-my-answers.json`);
      told.textContent = "Your answers are downloaded as a file.";
    } catch (error) {
      told.textContent = `Your answers cannot be downloaded just now. ${why(error)}`;
    }
  });
}

/** In a browser where people take part one after another: whoever leaves half-way is forgotten. */
function nextPerson(walk: Walk): void {
  const dialog = byId<HTMLDialogElement>("leaving");
  const problem = byId("leaving-problem");
  byId("next-person").addEventListener("click", () => {
    problem.textContent = "";
    dialog.showModal();
  });
  byId("leaving-not").addEventListener("click", () => dialog.close());
  byId("leaving-yes").addEventListener("click", () => {
    if (walk.allSaved) walk.leave();
    else problem.textContent = "Not everything is saved yet: please wait a moment, and try again.";
  });
}

function why(error: unknown): string {
  if (error instanceof Later) return "There is no connection to the study: please try again soon.";
  return error instanceof Error ? error.message : "";
}

function save(text: string, name: string): void {
  const url = URL.createObjectURL(new Blob([text], { type: "application/json" }));
  el("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}

/** Before anything is known of the study: what is the matter, and a way to try again. */
export function unreached(again: () => void): void {
  const main = byId("study");
  if (main.querySelector("#unreached")) return;
  main.replaceChildren(
    el("h1", { id: "unreached", tabindex: "-1" }, "The study cannot be reached just now"),
    el("p", {}, "Nothing is lost: what you have answered is saved. This page tries again by itself."),
    el("p", {}, "If it stays so, check your connection."),
    el("div", { class: "row" }, button("Try again", again, "main")),
  );
  main.querySelector("h1")!.focus();
}
