// What is said of a moment, in words.

import { at, last, type Payload, type Service, zone } from "./data";

export const ZONE_WORDS = ["far", "proper", "too near", "risky"];

export interface Moment {
  seconds: number;
  step: number;
  distance: number;
  sensed: number;
  zone: number;
  ended: boolean;
}

export function moment(data: Payload, service: Service, position: number): Moment {
  const distance = at(service.distance, position);
  return {
    seconds: position * data.interval * data.timestep,
    step: Math.round(position * data.interval),
    distance,
    sensed: last(service.sensed, position),
    zone: zone(data.limits, distance),
    ended: position >= service.frames - 1 - 1e-6,
  };
}

export function metres(value: number): string {
  return Number.isNaN(value) ? "none" : `${value.toFixed(2)} m`;
}

export function zoneBounds(limits: Payload["limits"], zone: number): string {
  const [risk, nearest, farthest] = [limits.risk, limits.nearest, limits.farthest].map((v) => v.toFixed(1));
  return [`> ${farthest} m`, `${nearest}–${farthest} m`, `${risk}–${nearest} m`, `< ${risk} m`][zone]!;
}

/** How an issue stands at a time: yes from a second on, not so far, no, or it does not apply. */
export function issueNow(service: Service, k: number, seconds: number, ended: boolean): string {
  const time = service.packed.times[k];
  const value = service.packed.issues[k]!;
  if (time != null && seconds >= time - 1e-6) return `yes, from ${time.toFixed(1)}\u00a0s${graded(value)}`;
  if (!ended) return "not so far";
  return value === null ? "does not apply" : `no${graded(value)}`;
}

/** The severity of a graded issue, nothing for a plain one. */
export function graded(value: number | null): string {
  return value === null || value === 0 || value === 1 ? "" : `, severity ${value.toFixed(2)}`;
}

/** A person in words: White, Female, Child, skin III, with a wheelchair. */
export function person(data: Payload, who: string[]): string {
  return Object.keys(data.identities)
    .map((identity, k) => category(identity, who[k]!))
    .join(", ");
}

/** A category that can be understood without its identity. */
export function category(identity: string, value: string): string {
  if (identity === "disability" && value === "Yes") return "with a disability (wheelchair)";
  if (identity === "disability" && value === "No") return "without a disability";
  if (["skin", "race", "gender"].includes(identity) && /^([IV]+|Other|not known)$/.test(value)) {
    return identity === "skin" ? `skin type ${value}` : `${identity} ${value.toLowerCase()}`;
  }
  return value;
}

export function issuesOf(data: Payload, service: { issues: (number | null)[] }): string[] {
  return data.issues.filter((_, k) => (service.issues[k] ?? 0) >= 0.5);
}

export function capital(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
