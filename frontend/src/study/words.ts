// Headings, and what is said when it cannot go on.

import type { Page, Study } from "./types";
import type { Walk } from "./walk";

export const NEXT = "The next person begins";

export function heading(page: Page, walk: Walk): string {
  const [number, all] = walk.ordinal(page);
  switch (page.kind) {
    case "about":
      return "About you";
    case "set":
      return `Robot ${number} of ${all}`;
    case "check":
      return "A short question";
    case "pair":
      return all > 1 ? `Compare two robots (${number} of ${all})` : "Compare two robots";
    case "end":
      return "Last questions";
    default:
      return "Thank you";
  }
}

export function introduction(page: Page): string {
  const several = (page.clips?.length ?? 0) > 1;
  switch (page.kind) {
    case "about":
      return "These questions are about yourself. You can leave out any of them.";
    case "set":
      return several
        ? "Watch the clips one after another, each to its end. All of them show the same robot. You can watch them again as often as you like."
        : "Watch the clip to its end. You can watch it again as often as you like.";
    case "pair":
      return "Watch what both robots do, each clip to its end. You can watch them again as often as you like.";
    default:
      return "";
  }
}

/** How the view with such a code is called, what it says, and what can be done. */
export interface Stop {
  title: string;
  text: string[];
  again: string;
  /** Whether the place of this participant is given up by going on. */
  anew: boolean;
}

export function stop(code: string, sentence: string, study: Study): Stop {
  const contact = study.contact ? `If that does not help, write to: ${study.contact}` : "";
  const kept =
    "Everything that was saved stays saved. What is not saved yet is kept in this browser.";
  switch (code) {
    case "elsewhere":
      return {
        title: "The study is open in another window",
        text: ["You go on there, and can close this window. Or go on here: nothing is lost."],
        again: "Go on here",
        anew: false,
      };
    case "withdrawn":
      return {
        title: "Your answers are deleted",
        text: [
          "You have withdrawn, and nothing that you answered is stored any more.",
          study.shared_computer ? "" : "You can close this page.",
        ],
        again: study.shared_computer ? NEXT : "",
        anew: false,
      };
    case "closed":
      return {
        title: "The study is closed",
        text: [sentence, kept, study.contact ? `Questions? Write to: ${study.contact}` : ""],
        again: "Try again",
        anew: false,
      };
    case "unknown-token":
      return {
        title: "Your place is not known any more",
        text: ["The study has no answers from this browser. You can begin it anew.", contact],
        again: "Begin anew",
        anew: true,
      };
    case "already-begun":
      return {
        title: "You have begun this study before",
        text: [sentence, study.contact ? `Questions? Write to: ${study.contact}` : ""],
        again: "Try again",
        anew: false,
      };
    case "other-consent":
      return {
        title: "The consent text has changed",
        text: ["Please read it again."],
        again: "Read it",
        anew: false,
      };
    default:
      return {
        title: "The study cannot go on just now",
        text: [sentence, kept, contact],
        again: "Try again",
        anew: false,
      };
  }
}
