/*!
 * Bundled: jsPsych, copyright Joshua R. de Leeuw; auto-bind, copyright Sindre Sorhus; random-words,
 * copyright Apostrophe Technologies, Inc.; seedrandom, copyright David Bau.
 * SPDX-License-Identifier: MIT
 */
// The participants' page of a study.

import { initJsPsych } from "jspsych";

import { api } from "./api";
import { byId, speak } from "./dom";
import { frame, unreached } from "./frame";
import { external, Memory } from "./memory";
import { pagePlugin } from "./plugin";
import type { Study } from "./types";
import { Walk } from "./walk";

const FIRST_WAIT = 1000;
const LONGEST_WAIT = 15_000;

async function reach(): Promise<Study> {
  for (let wait = FIRST_WAIT; ; wait = Math.min(2 * wait, LONGEST_WAIT)) {
    try {
      return await api.study();
    } catch {
      await new Promise<void>((resolve) => {
        const timer = setTimeout(resolve, wait);
        unreached(() => {
          clearTimeout(timer);
          resolve();
        });
      });
    }
  }
}

async function start(): Promise<void> {
  const ids = external();
  const study = await reach();
  speak(study.language);
  const walk = new Walk(study, new Memory(study.name, ids));
  const { update } = frame(walk);
  await walk.resume();
  const main = byId("study");
  main.replaceChildren();
  const jsPsych = initJsPsych({ display_element: main, use_webaudio: false });
  const trial = { type: pagePlugin(walk, update), place: () => walk.place, simulation_options: () => walk.place };
  const timeline = [{ timeline: [trial], loop_function: () => true }];
  // by the page's place, as the trial asks for it; filled when the server has told the pages
  if (window.evenhandSimulated) await jsPsych.simulate(timeline, "visual", walk.simulation);
  else await jsPsych.run(timeline);
}

void start();
