// What this browser remembers: the token, pages that are not saved yet, and what was typed.
//
// It lies in localStorage, so that a reload or a crash loses nothing. Where a browser allows none,
// it is kept for as long as the page is open, and `lasting` is false.

import type { Sent, Values } from "./types";

export interface Draft {
  values: Values;
  views: Record<string, number>;
  shown_ms: number;
}

export interface Waiting {
  page: string;
  sent: Sent;
}

export interface Notes {
  /** Made here, so that a beginning can be asked for again when no answer came. */
  token: string;
  /** Whether the server has confirmed the token. */
  begun: boolean;
  external: Record<string, string>;
  queue: Waiting[];
  drafts: Record<string, Draft>;
  sequence: number;
  /** Whether the end has been shown: nobody is sent on twice without asking. */
  ended: boolean;
}

const IDS = ["PROLIFIC_PID", "STUDY_ID", "SESSION_ID"];
/** As the server takes them; anything else is a placeholder that a platform did not fill in. */
const ID = /^[A-Za-z0-9][A-Za-z0-9_.:-]{0,99}$/;
const TOKEN = /^[A-Za-z0-9_-]{43}$/;
/** Characters that have to fit into the browser's memory, or it counts as none. */
const LEAST = 4000;

function random(bytes: number): Uint8Array {
  return crypto.getRandomValues(new Uint8Array(bytes));
}

/** 256 random bits, in the letters of URLs. */
function token(): string {
  const text = btoa(String.fromCharCode(...random(32)));
  return text.replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

/** A random UUID; `crypto.randomUUID` is there with HTTPS only. */
export function uuid(): string {
  const bytes = random(16);
  bytes[6] = (bytes[6]! & 0x0f) | 0x40;
  bytes[8] = (bytes[8]! & 0x3f) | 0x80;
  const hex = [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
  return hex.replace(/^(.{8})(.{4})(.{4})(.{4})(.{12})$/, "$1-$2-$3-$4-$5");
}

/** The browser's clock, for the record; it decides nothing, and may be wrong. */
export function clock(): string {
  const now = new Date();
  return Number.isNaN(now.getTime()) ? "" : now.toISOString();
}

/** Ids of a recruiting platform in the address, which are then taken out of it. */
export function external(): Record<string, string> {
  const asked = new URLSearchParams(location.search);
  const found: Record<string, string> = {};
  for (const name of IDS) {
    const value = asked.get(name);
    if (value !== null && ID.test(value)) found[name] = value;
    asked.delete(name);
  }
  const rest = asked.toString();
  history.replaceState(null, "", location.pathname + (rest ? `?${rest}` : "") + location.hash);
  return found;
}

export class Memory {
  readonly lasting: boolean;
  notes: Notes;
  private readonly store: Pick<Storage, "getItem" | "setItem" | "removeItem">;
  private readonly tab = uuid();
  private readonly prefix: string;
  private who: string;
  private kept = true;

  /** Whoever comes with other ids of a platform than the last one is somebody else. */
  constructor(name: string, ids: Record<string, string>) {
    this.prefix = `evenhand/${name}/`;
    const found = usable();
    this.lasting = found !== null;
    this.store = found ?? new Forgetful();
    const known = this.store.getItem(`${this.prefix}who`) ?? "";
    const own = [ids.PROLIFIC_PID, ids.STUDY_ID].filter((part) => part).join("/");
    this.who = own || known;
    this.store.setItem(`${this.prefix}who`, this.who);
    this.store.setItem(`${this.prefix}tab`, this.tab);
    this.notes = this.read() ?? this.fresh(ids);
    if (!this.notes.begun && own) this.notes.external = ids;
    // they are gone from the address, and have to outlast a reload before the beginning
    if (own) this.save();
  }

  /** Whether this window is the one that was opened last; the others stand still. */
  get mine(): boolean {
    return this.store.getItem(`${this.prefix}tab`) === this.tab;
  }

  /** Calls when another window takes over. */
  watch(taken: () => void): void {
    window.addEventListener("storage", () => {
      if (!this.mine) taken();
    });
    document.addEventListener("visibilitychange", () => {
      if (!document.hidden && !this.mine) taken();
    });
  }

  /** Writes everything down; false where that failed, for instance for want of space. */
  save(): boolean {
    if (!this.mine) return false;
    try {
      this.store.setItem(this.prefix + "notes/" + this.who, JSON.stringify(this.notes));
      this.kept = true;
    } catch {
      this.kept = false;
    }
    return this.kept;
  }

  /** Whether a reload would find everything. */
  get safe(): boolean {
    return this.lasting && this.kept;
  }

  /** Forgets this participant. */
  forget(): void {
    this.store.removeItem(this.prefix + "notes/" + this.who);
    this.store.removeItem(`${this.prefix}who`);
    this.notes = this.fresh({});
    this.who = "";
  }

  /** Begins anew, as the same person of a recruiting platform. */
  anew(): void {
    this.notes = this.fresh(this.notes.external);
    this.save();
  }

  private read(): Notes | null {
    const text = this.store.getItem(this.prefix + "notes/" + this.who);
    if (text === null) return null;
    try {
      const found = JSON.parse(text) as Notes;
      if (whole(found)) return found;
      // the server still knows whom the token belongs to
      return TOKEN.test(found.token) ? { ...this.fresh({}), token: found.token, begun: found.begun === true } : null;
    } catch {
      return null;
    }
  }

  private fresh(ids: Record<string, string>): Notes {
    return { token: token(), begun: false, external: ids, queue: [], drafts: {}, sequence: 0, ended: false };
  }
}

function thing(value: unknown): boolean {
  return typeof value === "object" && value !== null;
}

/** Whether notes are as this page writes them: anything else would stop it half-way. */
function whole(found: Notes): boolean {
  const { token, begun, external, queue, drafts, sequence } = found;
  if (!thing(external) || !thing(drafts) || !Array.isArray(queue)) return false;
  return (
    TOKEN.test(token) &&
    typeof begun === "boolean" &&
    Number.isInteger(sequence) &&
    queue.every((one) => thing(one) && typeof one.page === "string" && thing(one.sent)) &&
    Object.values(drafts).every((one) => thing(one) && thing(one.values) && thing(one.views))
  );
}

function usable(): Storage | null {
  try {
    localStorage.setItem("evenhand/test", "-".repeat(LEAST));
    localStorage.removeItem("evenhand/test");
    return localStorage;
  } catch {
    return null;
  }
}

class Forgetful {
  private readonly kept = new Map<string, string>();

  getItem(key: string): string | null {
    return this.kept.get(key) ?? null;
  }

  setItem(key: string, value: string): void {
    this.kept.set(key, value);
  }

  removeItem(key: string): void {
    this.kept.delete(key);
  }
}
