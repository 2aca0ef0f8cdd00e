// The page of `evenhand replay`: puts the parts together.

import { Curves } from "./curves";
import { byId, read, unpack } from "./data";
import { listen } from "./keys";
import { List } from "./list";
import { Player, SPEEDS } from "./player";
import { type Camera, CAMERAS, Stage } from "./stage";
import { capital, issueNow, metres, moment, person, ZONE_WORDS, zoneBounds } from "./words";

const NO_WEBGL =
  "This browser cannot draw the restaurant: WebGL is switched off or missing. Switch it on in the " +
  "browser\u2019s settings, or open this page in another browser. The curves, the list and the text still work.";
const LOST = "The picture was lost: the browser took WebGL away. Load the page again to see it.";
const CAMERA_NAMES: Record<Camera, [string, string]> = {
  room: ["Room", "Camera: the whole room (1)"],
  robot: ["Robot", "Camera: over the robot\u2019s shoulder (2)"],
  guest: ["Guest", "Camera: beside the guest (3)"],
  free: ["Free", "Camera: free, drag to turn it (4)"],
};
const PLAY = "M7 4.5v15l12.5-7.5z";
const PAUSE = "M6.5 5h4v14h-4zM13.5 5h4v14h-4z";

const data = read();
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const canvas = byId<HTMLCanvasElement>("view");
const scrub = byId<HTMLInputElement>("scrub");
const speed = byId<HTMLSelectElement>("speed");
const ringsBox = byId<HTMLInputElement>("rings");
const badge = byId("badge");
const facts = byId("facts");
const stage = openStage();
const values = tableOfFacts();
let camera: Camera = "room";
let atEnd = false; // played to its end: the next one is played too

const player = new Player(data, moved, changed, () => {
  atEnd = true;
  announce(data.services[player.row]!.outcome);
});
const farthest = Math.max(...data.services.flatMap((packed) => [...unpack(data, packed).distance]));
const curves = new Curves(data, byId("plots"), farthest, (seconds) => {
  atEnd = false;
  player.seek(seconds / player.tick);
});
const list = new List(data, choose);

function openStage(): Stage | null {
  const context = canvas.getContext("webgl2", { antialias: true, powerPreference: "low-power" });
  if (!context) {
    noPicture(NO_WEBGL);
    return null;
  }
  canvas.addEventListener("webglcontextlost", () => noPicture(LOST));
  return new Stage(data, canvas, context);
}

function noPicture(sentence: string): void {
  canvas.parentElement!.classList.add("flat");
  const note = byId("no-webgl");
  note.hidden = false;
  note.textContent = sentence;
  byId("cameras").hidden = true;
  ringsBox.parentElement!.hidden = true;
}

/** Terms stand still, so that only what changes is written. */
function tableOfFacts(): Record<string, HTMLElement> {
  const made: Record<string, HTMLElement> = {};
  const issues = data.issues.map((name, k) => [`issue ${k}`, capital(name)] as const);
  const plain = ["Time", "Distance", "Sensed", "Zone"].map((name) => [name.toLowerCase(), name] as const);
  for (const [key, name] of [...plain, ...issues]) {
    const pair = document.createElement("div");
    const [term, value] = [document.createElement("dt"), document.createElement("dd")];
    term.textContent = name;
    pair.append(term, value);
    facts.append(pair);
    made[key] = value;
  }
  return made;
}

function announce(text: string): void {
  byId("live").textContent = text;
}

function choose(row: number): void {
  const go = (player.playing || atEnd) && !calm.matches;
  atEnd = false;
  player.choose(row, go);
  const { packed } = player.service;
  stage?.show(player.service);
  curves.show(player.service);
  list.mark(row);
  scrub.max = String(player.end);
  const epoch = packed.epoch === null ? "" : ` of epoch ${packed.epoch}`;
  byId("player-title").textContent = `Service ${packed.number}${epoch}`;
  byId("who").textContent = `Asking: ${person(data, packed.who)}.`;
  byId<HTMLButtonElement>("before").disabled = list.beside(row, -1) === null;
  byId<HTMLButtonElement>("after").disabled = list.beside(row, 1) === null;
  canvas.setAttribute("aria-label", `The restaurant: service ${packed.number}. The curves and the text tell what is to be seen.`);
  announce(`Service ${packed.number}: ${person(data, packed.who)}.`);
  moved();
}

function moved(): void {
  const now = moment(data, player.service, player.position);
  stage?.move(player.position);
  curves.move(player.position);
  const zone = `${ZONE_WORDS[now.zone]!}, ${zoneBounds(data.limits, now.zone)}`;
  const time = `${now.seconds.toFixed(1)} s`;
  scrub.value = String(Math.round(player.position));
  scrub.setAttribute("aria-valuetext", `${time}, ${metres(now.distance)}, ${zone}`);
  byId("clock").textContent = `${now.seconds.toFixed(1)} / ${player.service.seconds.toFixed(1)} s`;
  badge.textContent = `${time} \u00b7 ${metres(now.distance)} \u00b7 ${ZONE_WORDS[now.zone]!}`;
  values["time"]!.textContent = `${time} (step ${now.step})`;
  values["distance"]!.textContent = metres(now.distance);
  values["sensed"]!.textContent = metres(now.sensed);
  values["zone"]!.textContent = ZONE_WORDS[now.zone]!;
  data.issues.forEach((_, k) => {
    values[`issue ${k}`]!.textContent = issueNow(player.service, k, now.seconds, now.ended);
  });
  byId("outcome").textContent = now.ended ? `Outcome: ${player.service.packed.outcome}` : "Outcome: at the end of the service.";
}

function changed(): void {
  byId("play-sign").setAttribute("d", player.playing ? PAUSE : PLAY);
  byId("play").setAttribute("aria-label", player.playing ? "Pause" : "Play");
}

function toggle(): void {
  atEnd = false;
  player.play(!player.playing);
}

function seek(position: number): void {
  atEnd = false;
  player.seek(position);
}

function beside(way: 1 | -1): void {
  const row = list.beside(player.row, way);
  if (row !== null) choose(row);
}

function look(wanted: Camera): void {
  camera = wanted;
  stage?.view(wanted);
  for (const button of byId("cameras").querySelectorAll("button")) {
    button.setAttribute("aria-pressed", String(button.dataset["camera"] === wanted));
  }
  canvas.tabIndex = wanted === "free" ? 0 : -1;
}

function setSpeed(value: number): void {
  player.speed = value;
  speed.value = String(value);
}

for (const name of CAMERAS) {
  const button = document.createElement("button");
  button.type = "button";
  button.dataset["camera"] = name;
  [button.textContent, button.title] = CAMERA_NAMES[name];
  button.addEventListener("click", () => look(name));
  byId("cameras").append(button);
}
for (const value of SPEEDS) speed.add(new Option(`${value}\u00d7`, String(value)));
speed.addEventListener("change", () => setSpeed(Number(speed.value)));
scrub.addEventListener("input", () => seek(Number(scrub.value)));
ringsBox.addEventListener("change", () => stage?.showRings(ringsBox.checked));
byId("play").addEventListener("click", toggle);
byId("before").addEventListener("click", () => beside(-1));
byId("after").addEventListener("click", () => beside(1));
byId("filters").addEventListener("change", () => {
  byId<HTMLButtonElement>("before").disabled = list.beside(player.row, -1) === null;
  byId<HTMLButtonElement>("after").disabled = list.beside(player.row, 1) === null;
});

listen(
  {
    toggle,
    step: (poses) => seek((poses > 0 ? Math.floor(player.position + 1e-6) : Math.ceil(player.position - 1e-6)) + poses),
    home: () => seek(0),
    end: () => seek(player.end),
    service: beside,
    camera: (k) => stage && look(CAMERAS[k]!),
    faster: (way) => setSpeed(SPEEDS[SPEEDS.indexOf(player.speed) + way] ?? player.speed),
    rings: () => ringsBox.click(),
    turn: (sideways, upwards, nearer) => stage?.turn(sideways, upwards, nearer),
  },
  () => camera === "free",
);

/** The service that the address names, as `#service-17`. */
function addressed(): number {
  const number = Number(/^#service-(\d+)$/.exec(location.hash)?.[1] ?? NaN);
  return data.services.findIndex((service) => service.number === number);
}
window.addEventListener("hashchange", () => {
  if (addressed() >= 0) choose(addressed());
});

setSpeed(1);
look("room");
choose(Math.max(addressed(), 0));
