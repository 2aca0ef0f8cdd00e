// Elements. Text is always set as text, never as HTML.

type Child = Node | string | null;
type Attributes = Record<string, string | boolean>;

export function el<K extends keyof HTMLElementTagNameMap>(
  name: K,
  attributes: Attributes = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === true) made.setAttribute(key, "");
    else if (value !== false) made.setAttribute(key, value);
  }
  made.append(...children.filter((child) => child !== null));
  return made;
}

export function byId<T extends HTMLElement = HTMLElement>(id: string): T {
  return document.getElementById(id) as T;
}

let language = "en";

/** The language of the study's own texts. */
export function speak(of: string): void {
  language = of;
}

/** Marks an element whose text is the study's: a screen reader then speaks its language. */
export function inItsLanguage<T extends HTMLElement>(element: T): T {
  if (language !== "en") element.lang = language;
  return element;
}

/** The study's text: a blank line parts paragraphs, single ends of lines are spaces. */
export function paragraphs(text: string): HTMLElement {
  const parts = text.trim().split(/\n[ \t]*\n\s*/);
  return inItsLanguage(el("div", { class: "prose" }, ...parts.map((part) => el("p", {}, part))));
}

export function button(label: string, act: () => void, kind = ""): HTMLButtonElement {
  const made = el("button", { type: "button", class: kind }, label);
  made.addEventListener("click", act);
  return made;
}
