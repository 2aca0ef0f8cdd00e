// Questions as fields of a form: native radios, checkboxes and text areas.

import { button, el, inItsLanguage } from "./dom";
import type { Question, Value, Values } from "./types";

/** What is missing or wrong, and where to mend it. */
export interface Lack {
  question: Question;
  sentence: string;
  field: HTMLElement;
}

interface Field {
  element: HTMLElement;
  read(): Value;
  fill(value: Value): void;
  focus: HTMLElement;
}

export class Fields {
  readonly element = el("div", { class: "questions" });
  private readonly fields = new Map<string, Field>();

  /** Calls `changed` after every change. */
  constructor(
    private readonly questions: Question[],
    private readonly changed: () => void,
  ) {
    for (const question of questions) {
      const field = question.type === "text" ? this.text(question) : this.chosen(question);
      this.fields.set(question.id, field);
      this.element.append(field.element);
    }
  }

  get values(): Values {
    return Object.fromEntries([...this.fields].map(([id, field]) => [id, field.read()]));
  }

  fill(values: Values): void {
    for (const [id, field] of this.fields) field.fill(values[id] ?? null);
  }

  /** Says beside every question what is wrong, and returns all of it. */
  check(): Lack[] {
    const found: Lack[] = [];
    for (const question of this.questions) {
      const field = this.fields.get(question.id)!;
      const sentence = wrong(question, field.read());
      mark(question, field, sentence);
      if (sentence) found.push({ question, sentence, field: field.focus });
    }
    return found;
  }

  private chosen(question: Question): Field {
    const many = question.type === "choices";
    const scale = question.type === "scale";
    const inputs: [HTMLInputElement, Value][] = [];
    const list = el("div", { class: scale ? "scale" : "options" });
    const options = scale ? points(question) : (question.options ?? []);
    options.forEach(({ value, label }, k) => {
      const input = el("input", {
        type: many ? "checkbox" : "radio",
        id: `${name(question)}-${k}`,
        name: name(question),
        value,
      });
      inputs.push([input, scale ? Number(value) : value]);
      const words = inItsLanguage(el("span", {}, label));
      list.append(el("label", { class: "option", for: input.id }, input, words));
    });
    const fieldset = el(
      "fieldset",
      { id: name(question), class: "question" },
      el("legend", {}, inItsLanguage(el("span", {}, question.ask)), tag(question)),
      scale ? ends(question) : null,
      many ? el("p", { class: "hint" }, "You can choose several.") : null,
      list,
    );
    const clear = button("Clear this answer", () => {
      for (const [input] of inputs) input.checked = false;
      inputs[0]?.[0].focus();
      clear.hidden = true;
      this.changed();
    }, "plain small");
    clear.hidden = true;
    // a radio cannot be taken back by itself; where there is an answer that says nothing, it can
    const stuck = !many && !question.required && !options.some((one) => one.value === "Prefer not to say");
    if (stuck) fieldset.append(clear);
    const read = (): Value => {
      const picked = inputs.filter(([input]) => input.checked).map(([, value]) => value);
      if (many) return picked.length ? (picked as string[]) : null;
      return picked[0] ?? null;
    };
    fieldset.addEventListener("change", () => {
      clear.hidden = false;
      if (fieldset.dataset.wrong) mark(question, field, wrong(question, read()));
      this.changed();
    });
    const field: Field = {
      element: fieldset,
      read,
      fill: (value) => {
        for (const [input, own] of inputs) {
          input.checked = Array.isArray(value) ? value.includes(String(own)) : value === own;
        }
        clear.hidden = read() === null;
      },
      focus: inputs[0]![0],
    };
    return field;
  }

  private text(question: Question): Field {
    const longest = question.longest ?? 2000;
    const id = `${name(question)}-0`;
    const area = el("textarea", { id, rows: "5", "aria-describedby": `${id}-left` });
    const left = el("p", { class: "hint", id: `${id}-left` });
    // told by a screen reader near the end only: each key would be too much
    const told = el("p", { class: "unseen", role: "status" });
    const count = () => {
      const rest = longest - [...written(area.value)].length;
      const words = rest < 0 ? `${-rest} characters too many` : `${rest} characters left`;
      left.textContent = `${words}, of ${longest}.`;
      left.classList.toggle("wrong", rest < 0);
      told.textContent = rest < longest / 10 ? words : "";
    };
    area.addEventListener("input", () => {
      count();
      if (box.dataset.wrong) mark(question, field, wrong(question, written(area.value)));
      this.changed();
    });
    const label = el("label", { for: id }, inItsLanguage(el("span", {}, question.ask)), tag(question));
    const box = el("div", { id: name(question), class: "question" }, label, area, left, told);
    const field: Field = {
      element: box,
      read: () => written(area.value) || null,
      fill: (value) => {
        area.value = typeof value === "string" ? value : "";
        count();
      },
      focus: area,
    };
    count();
    return field;
  }
}

/** Text without blank ends, and without halves of characters, which no server takes. */
function written(text: string): string {
  return text.replace(/\p{Cs}/gu, "").trim();
}

function name(question: Question): string {
  return `q-${question.id}`;
}

function tag(question: Question): HTMLElement | null {
  return question.required ? el("span", { class: "tag" }, " (needs an answer)") : null;
}

/** The points of a scale; the ends are named in words, for eyes and ears. */
function points(question: Question): { value: string; label: string }[] {
  const n = question.points ?? 7;
  return Array.from({ length: n }, (_, k) => {
    const end = k === 0 ? question.low : k === n - 1 ? question.high : "";
    return { value: String(k + 1), label: end ? `${k + 1}: ${end}` : String(k + 1) };
  });
}

function ends(question: Question): HTMLElement | null {
  if (!question.low && !question.high) return null;
  const n = question.points ?? 7;
  const words = [question.low && `1 = ${question.low}`, question.high && `${n} = ${question.high}`];
  return inItsLanguage(el("p", { class: "hint" }, words.filter(Boolean).join(", ") + "."));
}

function wrong(question: Question, value: Value): string {
  if (question.type === "text") {
    const longest = question.longest ?? 2000;
    const text = typeof value === "string" ? value : "";
    const over = [...text].length - longest;
    if (over > 0) return `Write ${over} characters less.`;
    return question.required && !text ? "Write an answer." : "";
  }
  if (!question.required || value !== null) return "";
  return question.type === "choices" ? "Choose one or more answers." : "Choose an answer.";
}

function mark(question: Question, field: Field, sentence: string): void {
  const { element, focus } = field;
  const id = `${name(question)}-wrong`;
  document.getElementById(id)?.remove();
  const text = question.type === "text";
  const described = text ? focus : element;
  const before = text ? `${focus.id}-left` : "";
  if (sentence) {
    const line = el("p", { id, class: "wrong" }, `Error: ${sentence}`);
    element.querySelector("legend, label")!.after(line);
    element.dataset.wrong = "yes";
    described.setAttribute("aria-describedby", `${id} ${before}`.trim());
    if (text) focus.setAttribute("aria-invalid", "true");
    return;
  }
  delete element.dataset.wrong;
  if (before) described.setAttribute("aria-describedby", before);
  else described.removeAttribute("aria-describedby");
  focus.removeAttribute("aria-invalid");
}
