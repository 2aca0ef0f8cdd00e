// The one trial of the study's timeline: it shows whatever view is next, and ends with it.
//
// jsPsych's own plugins for questions and clips build HTML from strings, take no focus, and know no
// drafts; the fields and the player here are ours.

import { type JsPsych, type JsPsychPlugin, ParameterType } from "jspsych";

import { el } from "./dom";
import { show, type Shown } from "./pages";
import type { Simulated, Study } from "./types";
import type { Walk } from "./walk";

/** Milliseconds in which the second half of a double click still comes. */
const DOUBLE = 500;

const info = <const>{
  name: "evenhand-page",
  version: "1.0.0",
  parameters: {
    /** Which view, so that jsPsych's own record says what was shown. */
    place: { type: ParameterType.STRING, default: "" },
  },
  data: {
    /** The view that was shown. */
    place: { type: ParameterType.STRING },
    /** How long, in milliseconds. */
    rt: { type: ParameterType.INT },
  },
};

type Info = typeof info;

/** The plugin for one walk through a study. */
export function pagePlugin(walk: Walk, update: () => void) {
  let opened = 0;
  const second = (event: MouseEvent) => {
    // it is meant for the page before: here it would play a clip, or choose an answer
    if (event.detail < 2 || performance.now() - opened > DOUBLE) return;
    event.preventDefault();
    event.stopPropagation();
  };
  document.addEventListener("click", second, { capture: true });
  return class PagePlugin implements JsPsychPlugin<Info> {
    static readonly info = info;

    constructor(readonly jsPsych: JsPsych) {}

    trial(): void {
      this.open();
    }

    simulate(_trial: unknown, _mode: string, options: { data?: Partial<Simulated> }, load: () => void): void {
      const shown = this.open();
      load();
      const { values, shown_ms } = options.data ?? {};
      void shown.simulate?.(values && shown_ms !== undefined ? { values, shown_ms } : undefined);
    }

    private open(): Shown {
      const display = this.jsPsych.getDisplayElement();
      // jsPsych makes it a stop of the tab key, where there is nothing to do
      this.jsPsych.getDisplayContainerElement().tabIndex = -1;
      const since = performance.now();
      opened = since;
      const place = walk.place;
      const shown = show(walk.view, walk);
      const title = el("h1", { tabindex: "-1" }, shown.title);
      display.replaceChildren(title, ...shown.nodes);
      update();
      entitle(shown.title, walk.study);
      walk.moved = () => {
        if (walk.place === place) return;
        walk.moved = () => {};
        shown.gone?.();
        this.jsPsych.finishTrial({ place, rt: Math.round(performance.now() - since) });
      };
      const summary = display.querySelector<HTMLElement>(".summary:not([hidden])");
      window.scrollTo(0, 0);
      (summary ?? title).focus({ preventScroll: true });
      // what came while the page was built
      queueMicrotask(() => walk.moved());
      return shown;
    }
  };
}

function entitle(title: string, study: Study): void {
  document.title = title === study.title ? title : `${title} \u2013 ${study.title}`;
}
