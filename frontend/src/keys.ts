// Keys. They leave alone what has keys of its own, and can be switched off.

import { byId } from "./data";

export interface Actions {
  toggle(): void;
  step(poses: number): void;
  home(): void;
  end(): void;
  service(way: 1 | -1): void;
  camera(number: number): void;
  faster(way: 1 | -1): void;
  rings(): void;
  /** True when the picture took the key for its free camera. */
  turn(sideways: number, upwards: number, nearer: number): void;
}

const LISTED: [string[], string][] = [
  [["Space"], "play or pause"],
  [["\u2190", "\u2192"], "a tenth of a second back or on; with Shift a second"],
  [["Home", "End"], "to the beginning or the end"],
  [["n", "p"], "next service or the one before, of those that match"],
  [["1", "2", "3", "4"], "camera: room, robot, guest, free"],
  [["+", "\u2212"], "faster or slower"],
  [["r"], "rings on the floor"],
  [["?"], "this help; Esc closes it"],
  [["\u2190 \u2192 \u2191 \u2193", "+ \u2212"], "on the picture, with the free camera: turn, nearer, farther"],
];

export function listen(actions: Actions, free: () => boolean): void {
  const help = byId<HTMLDialogElement>("help");
  const on = byId<HTMLInputElement>("keys-on");
  const list = byId("key-list");
  for (const [keys, text] of LISTED) {
    const term = document.createElement("dt");
    keys.forEach((key, k) => {
      const cap = document.createElement("kbd");
      cap.textContent = key;
      term.append(...(k ? [" "] : []), cap);
    });
    const meaning = document.createElement("dd");
    meaning.textContent = text;
    list.append(term, meaning);
  }
  const open = () => {
    if (!help.open) help.showModal();
  };
  byId("help-open").addEventListener("click", open);

  const act = (event: KeyboardEvent): boolean => {
    const target = event.target as HTMLElement;
    const many = event.shiftKey ? 10 : 1;
    const picture = target.id === "view" && free();
    switch (event.key) {
      case " ": {
        const current = target.getAttribute("aria-current") === "true";
        if (target.closest("button, a, summary, input[type=checkbox]") && !current) return false;
        actions.toggle();
        return true;
      }
      case "ArrowLeft":
        picture ? actions.turn(-0.12, 0, 1) : actions.step(-many);
        return true;
      case "ArrowRight":
        picture ? actions.turn(0.12, 0, 1) : actions.step(many);
        return true;
      case "ArrowUp":
      case "ArrowDown": {
        const way = event.key === "ArrowUp" ? 1 : -1;
        if (picture) actions.turn(0, 0.1 * way, 1);
        else if (target.id === "scrub") actions.step(many * way);
        else return false; // the page scrolls
        return true;
      }
      case "Home":
        actions.home();
        return true;
      case "End":
        actions.end();
        return true;
    }
    if (!on.checked && event.key !== "?") return false;
    switch (event.key) {
      case "n":
      case "p":
        actions.service(event.key === "n" ? 1 : -1);
        return true;
      case "1":
      case "2":
      case "3":
      case "4":
        actions.camera(Number(event.key) - 1);
        return true;
      case "+":
      case "=":
      case "-": {
        const way = event.key === "-" ? -1 : 1;
        picture ? actions.turn(0, 0, 1 - 0.12 * way) : actions.faster(way);
        return true;
      }
      case "r":
        actions.rings();
        return true;
      case "?":
        open();
        return true;
    }
    return false;
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || help.open) return;
    if ((event.target as HTMLElement).closest("select, textarea, input[type=text]")) return;
    if (act(event)) event.preventDefault();
  });
}
