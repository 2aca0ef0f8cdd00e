// The list of services: filters by identity and issue, how many match, and which one is chosen.

import { byId, type Payload } from "./data";
import { capital, category, issuesOf, person } from "./words";

const ANY = "";
const NONE = "none";

export class List {
  private readonly selects: HTMLSelectElement[] = [];
  private readonly buttons: HTMLButtonElement[] = [];
  private readonly issue: HTMLSelectElement;
  /** Rows of the services that match, in order. */
  matching: number[];

  constructor(
    private readonly data: Payload,
    choose: (row: number) => void,
  ) {
    const form = byId("filters");
    for (const [identity, categories] of Object.entries(data.identities)) {
      const known = data.services.some(({ who }) => who[this.selects.length] === "not known");
      const options = known ? [...categories, "not known"] : categories;
      const named = options.map((value) => [value, capital(category(identity, value))] as const);
      this.selects.push(this.select(form, capital(identity), [[ANY, "Any"], ...named]));
    }
    const issues = data.issues.map((name) => [name, capital(name)] as const);
    this.issue = this.select(form, "Issue", [
      [ANY, "Any"],
      ["any", "Some"],
      ...issues,
      [NONE, "None"],
    ]);
    const list = byId("services");
    data.services.forEach((service, row) => {
      const button = document.createElement("button");
      button.type = "button";
      const name = document.createElement("b");
      name.textContent = `Service ${service.number}`;
      const who = document.createElement("small");
      who.textContent = person(data, service.who);
      button.append(name, who, this.tags(issuesOf(data, service)));
      button.addEventListener("click", () => choose(row));
      const entry = document.createElement("li");
      entry.append(button);
      list.append(entry);
      this.buttons.push(button);
    });
    byId("reset").addEventListener("click", () => {
      for (const select of [...this.selects, this.issue]) select.value = ANY;
      this.filter();
      this.selects[0]?.focus();
    });
    form.addEventListener("submit", (event) => event.preventDefault());
    this.matching = data.services.map((_, row) => row);
    this.filter();
  }

  mark(row: number): void {
    this.buttons.forEach((button, k) => {
      if (k === row) button.setAttribute("aria-current", "true");
      else button.removeAttribute("aria-current");
    });
    const list = byId("services");
    const entry = this.buttons[row]!.parentElement!;
    if (list.scrollHeight > list.clientHeight + 1) {
      // scrolls the list alone, never the page
      const [from, to] = [entry.offsetTop - list.offsetTop, entry.offsetTop - list.offsetTop + entry.offsetHeight];
      if (from < list.scrollTop) list.scrollTop = from - 6;
      else if (to > list.scrollTop + list.clientHeight) list.scrollTop = to - list.clientHeight + 6;
    }
  }

  /** The matching service before (-1) or after (1) a row; null where there is none. */
  beside(row: number, way: 1 | -1): number | null {
    const rows = way === 1 ? this.matching : [...this.matching].reverse();
    return rows.find((other) => (other - row) * way > 0) ?? null;
  }

  private tags(issues: string[]): HTMLElement {
    const tags = document.createElement("span");
    tags.className = "tags";
    for (const name of issues.length ? issues : ["no issue"]) {
      const tag = document.createElement("span");
      tag.className = issues.length ? "tag" : "tag fine";
      tag.textContent = `${issues.length ? "!" : "\u2713"} ${name}`;
      tags.append(tag);
    }
    return tags;
  }

  private select(form: HTMLElement, label: string, options: (readonly [string, string])[]): HTMLSelectElement {
    const wrap = document.createElement("label");
    wrap.append(label);
    const select = document.createElement("select");
    select.setAttribute("aria-label", label); // the label alone, without the options inside it
    for (const [value, text] of options) select.add(new Option(text, value));
    select.addEventListener("change", () => this.filter());
    wrap.append(select);
    form.append(wrap);
    return select;
  }

  private filter(): void {
    const { data } = this;
    const wanted = this.issue.value;
    this.matching = [];
    data.services.forEach((service, row) => {
      const issues = issuesOf(data, service);
      const alike = this.selects.every(({ value }, k) => value === ANY || service.who[k] === value);
      const met =
        wanted === ANY ||
        (wanted === "any" ? issues.length > 0 : wanted === NONE ? !issues.length : issues.includes(wanted));
      this.buttons[row]!.parentElement!.hidden = !(alike && met);
      if (alike && met) this.matching.push(row);
    });
    const [some, all] = [this.matching.length, data.services.length];
    byId("matches").textContent = `${some} of ${all} match`;
    byId("reset").hidden = some === all;
  }
}
