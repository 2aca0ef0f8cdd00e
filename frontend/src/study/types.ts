// What the server tells (src/evenhand/study/design/orders.py, web/models.py), and what it is told.

export interface Study {
  name: string;
  title: string;
  language: string;
  minutes: number;
  contact: string;
  consent: { version: string; text: string };
  pages_total: number;
  preview: boolean;
  /** Whether people take part one after another in this browser. */
  shared_computer: boolean;
}

export interface Option {
  value: string;
  label: string;
}

export interface Question {
  id: string;
  ask: string;
  type: "scale" | "choice" | "choices" | "text" | "pair";
  required: boolean;
  points?: number;
  low?: string;
  high?: string;
  options?: Option[];
  longest?: number;
}

export interface Clips {
  clips: string[];
  captions: string[];
}

export interface Page {
  id: string;
  kind: "consent" | "about" | "set" | "check" | "pair" | "end" | "finished";
  item?: string;
  questions?: Question[];
  clips?: string[];
  captions?: string[];
  first?: Clips;
  second?: Clips;
  thanks?: string;
}

export interface State {
  pages: Page[];
  answered: Record<string, number>;
  next: string;
  finished: boolean;
}

export type Value = string | number | string[] | null;
export type Values = Record<string, Value>;

/** Body of PUT /api/pages/{page}. */
export interface Sent {
  key: string;
  sequence: number;
  values: Values;
  shown_ms: number;
  clip_views: Record<string, number>;
  at: string;
}

export interface Ending {
  code: string;
  redirect: string;
}

/** What is shown. */
export type View =
  | { kind: "consent" }
  | { kind: "page"; page: Page; problem: string }
  | { kind: "saving" }
  | { kind: "finished"; page: Page; ending: Ending; fresh: boolean }
  | { kind: "stop"; code: string; sentence: string };

/** Whether the server has everything; if not, whether there is no connection or no room. */
export type Saved = "nothing" | "saved" | "saving" | "offline" | "busy";

/** What a simulated participant answers to a page. */
export interface Simulated {
  values: Values;
  shown_ms: number;
}

declare global {
  interface Window {
    /**
     * There when simulated participants take the study (study/walking.py): told the pages, it gives
     * the answers by page; a page without one is where the participant leaves.
     */
    evenhandSimulated?: (pages: Page[]) => Promise<Record<string, Simulated>>;
  }
}
