// Requests. Every one can fail in three ways: no answer, not now, or no.

import type { Ending, Page, Sent, State, Study } from "./types";

const PATIENCE = 20_000;

/** No answer, or one that says to ask again later. */
export class Later extends Error {
  constructor(
    readonly offline: boolean,
    readonly seconds: number,
  ) {
    super(offline ? "no connection" : "not now");
  }
}

/** The server said no, in a sentence. */
export class Refusal extends Error {
  constructor(
    readonly status: number,
    readonly code: string,
    sentence: string,
  ) {
    super(sentence);
  }
}

interface Wrong {
  error?: unknown;
  code?: unknown;
}

async function ask(method: string, path: string, token?: string, body?: unknown, extra = {}): Promise<Response> {
  const headers: Record<string, string> = { ...extra };
  if (token) headers.authorization = `Bearer ${token}`;
  if (body !== undefined) headers["content-type"] = "application/json";
  let answer: Response;
  try {
    answer = await fetch(`/api${path}`, {
      method,
      headers,
      body: body === undefined ? null : JSON.stringify(body),
      cache: "no-store",
      signal: AbortSignal.timeout(PATIENCE),
    });
  } catch {
    throw new Later(true, 0);
  }
  if (answer.ok) return answer;
  if (answer.status === 429 || answer.status >= 500) {
    throw new Later(false, Number(answer.headers.get("retry-after")) || 0);
  }
  const told = (await answer.json().catch(() => ({}))) as Wrong;
  throw new Refusal(
    answer.status,
    typeof told.code === "string" ? told.code : "invalid",
    typeof told.error === "string" ? told.error : `The server refused (${answer.status}).`,
  );
}

async function read<T>(asked: Promise<Response>): Promise<T> {
  const answer = await asked;
  try {
    return (await answer.json()) as T;
  } catch {
    throw new Later(true, 0); // the connection broke within the answer
  }
}

export interface Agreed {
  consent_version: string;
  token: string;
  external?: Record<string, string>;
  simulated?: boolean;
}

export const api = {
  study: () => read<Study>(ask("GET", "/study")),
  begin: (agreed: Agreed) =>
    read<{ token: string; state: State }>(
      ask("POST", "/begin", undefined, agreed, agreed.simulated ? { "x-evenhand-simulated": "yes" } : {}),
    ),
  state: (token: string) => read<State>(ask("GET", "/state", token)),
  save: (token: string, page: Page["id"], sent: Sent) =>
    read<{ next: string; repeated: boolean }>(
      ask("PUT", `/pages/${encodeURIComponent(page)}`, token, sent),
    ),
  finish: (token: string) => read<Ending>(ask("POST", "/finish", token, {})),
  mine: (token: string) => read<Record<string, unknown>>(ask("GET", "/mine", token)),
  withdraw: (token: string) => read<{ deleted: true }>(ask("DELETE", "/mine", token)),
};
