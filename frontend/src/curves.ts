// Three curves beside the picture: distance, zone, issues. They share one axis of time, and a cursor.

import { at, type Payload, type Service, zone, ZONES } from "./data";
import { capital, graded, issueNow, metres, moment, zoneBounds } from "./words";

const WIDE = 400;
const LEFT = 78;
const RIGHT = 392;
const SVG = "http://www.w3.org/2000/svg";

type Attributes = Record<string, string | number>;

function draw(parent: Element, name: string, attributes: Attributes, text = ""): SVGElement {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  if (text) made.textContent = text;
  parent.append(made);
  return made;
}

interface Plot {
  svg: SVGElement;
  now: HTMLElement;
  high: number;
  title: string;
}

export class Curves {
  private readonly plots: Plot[];
  private readonly farthest: number;
  private readonly longest: number;
  private cursors: SVGElement[] = [];
  private dot: SVGElement | null = null;
  private service: Service | null = null;

  constructor(
    private readonly data: Payload,
    parent: HTMLElement,
    farthest: number,
    private readonly seek: (seconds: number) => void,
  ) {
    this.longest = data.most_steps * data.timestep;
    this.farthest = Math.max(2, Math.ceil(2 * farthest) / 2);
    this.plots = [
      this.plot(parent, "Distance", 176),
      this.plot(parent, "Zone the robot is in", 118),
      this.plot(parent, "Issues", 26 + 23 * data.issues.length),
    ];
  }

  show(service: Service): void {
    this.service = service;
    this.cursors = [];
    for (const { svg } of this.plots) svg.replaceChildren();
    this.drawDistance(service, this.plots[0]!);
    this.drawZones(service, this.plots[1]!);
    this.drawIssues(service, this.plots[2]!);
    for (const { svg, high } of this.plots) {
      this.cursors.push(draw(svg, "line", { class: "cursor", y1: 4, y2: high - 20 }));
    }
    this.dot = draw(this.plots[0]!.svg, "circle", { class: "dot", r: 5.5 });
  }

  move(position: number): void {
    const { service, data } = this;
    if (!service) return;
    const now = moment(data, service, position);
    const x = this.x(now.seconds).toFixed(1);
    for (const cursor of this.cursors) {
      cursor.setAttribute("x1", x);
      cursor.setAttribute("x2", x);
    }
    this.dot!.setAttribute("cx", x);
    this.dot!.setAttribute("cy", this.y(now.distance).toFixed(1));
    const met = data.issues.filter((_, k) => issueNow(service, k, now.seconds, now.ended)[0] === "y");
    this.plots[0]!.now.textContent = `${metres(now.distance)}, sensed ${metres(now.sensed)}`;
    this.plots[1]!.now.textContent = `${ZONES[now.zone]!} (${zoneBounds(data.limits, now.zone)})`;
    this.plots[2]!.now.textContent = met.length ? met.join(", ") : now.ended ? "none" : "none so far";
  }

  private plot(parent: HTMLElement, title: string, high: number): Plot {
    const figure = document.createElement("div");
    figure.className = "plot";
    const head = document.createElement("div");
    head.className = "head";
    const name = document.createElement("h3");
    name.textContent = title;
    const now = document.createElement("span");
    now.className = "now";
    head.append(name, now);
    figure.append(head);
    if (title === "Distance") figure.append(this.key());
    const svg = draw(figure, "svg", { viewBox: `0 0 ${WIDE} ${high}`, role: "img" });
    parent.append(figure);
    const go = (event: PointerEvent) => {
      const box = svg.getBoundingClientRect();
      const across = ((event.clientX - box.left) / box.width) * WIDE;
      this.seek(((across - LEFT) / (RIGHT - LEFT)) * this.longest);
    };
    svg.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      if (event.pointerType === "mouse") svg.setPointerCapture(event.pointerId);
      go(event);
    });
    svg.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) go(event);
    });
    return { svg, now, high, title };
  }

  private key(): HTMLElement {
    const key = document.createElement("p");
    key.className = "key";
    for (const [label, paint] of [
      ["true", (svg: Element) => draw(svg, "line", { class: "true", x1: 1, x2: 25, y1: 6, y2: 6 })],
      ["as the robot sensed it", (svg: Element) => draw(svg, "circle", { class: "sensed", cx: 13, cy: 6, r: 3 })],
    ] as const) {
      const entry = document.createElement("span");
      paint(draw(entry, "svg", { viewBox: "0 0 26 12", "aria-hidden": "true" }));
      entry.append(label);
      key.append(entry);
    }
    return key;
  }

  private x(seconds: number): number {
    return LEFT + (seconds / this.longest) * (RIGHT - LEFT);
  }

  private y(distance: number): number {
    const [top, bottom] = [8, this.plots[0]!.high - 20];
    return bottom - (Math.min(distance, this.farthest) / this.farthest) * (bottom - top);
  }

  private seconds(pose: number): number {
    return pose * this.data.interval * this.data.timestep;
  }

  private axis(svg: Element, high: number): void {
    const bottom = high - 20;
    draw(svg, "path", { class: "axis", d: `M${LEFT} 4V${bottom}H${RIGHT}` });
    for (let s = 0; s <= this.longest + 1e-9; s++) {
      const x = this.x(s);
      draw(svg, "path", { class: "axis", d: `M${x} ${bottom}v4` });
      const label = s + 1 > this.longest ? `${s} s` : `${s}`;
      draw(svg, "text", { x, y: bottom + 16, "text-anchor": "middle" }, label);
    }
  }

  private drawDistance(service: Service, { svg, high }: Plot): void {
    const { limits } = this.data;
    const [near, far, risk] = [this.y(limits.nearest), this.y(limits.farthest), this.y(limits.risk)];
    const span = { x: LEFT, width: RIGHT - LEFT };
    draw(svg, "rect", { class: "band", ...span, y: far, height: near - far });
    draw(svg, "rect", { class: "danger", ...span, y: risk, height: high - 20 - risk });
    for (const limit of [limits.risk, limits.nearest, limits.farthest]) {
      const y = this.y(limit);
      draw(svg, "line", { class: "rule", x1: LEFT, x2: RIGHT, y1: y, y2: y });
      draw(svg, "text", { x: LEFT - 6, y: y + 4, "text-anchor": "end" }, `${limit.toFixed(1)} m`);
    }
    for (let m = 2; m <= this.farthest; m++) {
      if (m - limits.farthest < 0.3) continue;
      draw(svg, "text", { x: LEFT - 6, y: this.y(m) + 4, "text-anchor": "end" }, `${m} m`);
    }
    this.axis(svg, high);
    service.sensed.forEach((value, k) => {
      if (Number.isNaN(value)) return;
      draw(svg, "circle", { class: "sensed", cx: this.x(this.seconds(k)), cy: this.y(value), r: 2.6 });
    });
    const points = [...service.distance].map((d, k) => `${this.x(this.seconds(k))} ${this.y(d)}`);
    draw(svg, "path", { class: "true", d: `M${points.join("L")}` });
    const [first, end] = [service.distance[0]!, service.distance[service.frames - 1]!];
    const least = Math.min(...service.distance);
    svg.setAttribute(
      "aria-label",
      `True distance over ${service.seconds.toFixed(1)} s: begins at ${metres(first)}, ends at ` +
        `${metres(end)}, at least ${metres(least)}.`,
    );
  }

  private lane(svg: Element, k: number, label: string): { y: number; high: number } {
    const y = 6 + 23 * k;
    const bold = { x: LEFT - 6, y: y + 14, "text-anchor": "end" };
    draw(svg, "rect", { class: "lane", x: LEFT, y, width: RIGHT - LEFT, height: 19 });
    draw(svg, "text", bold, label);
    return { y, high: 19 };
  }

  private drawZones(service: Service, { svg, high }: Plot): void {
    const { limits } = this.data;
    ZONES.forEach((name, k) => this.lane(svg, k, capital(name)));
    const spans: { zone: number; from: number; to: number }[] = [];
    const fine = 10; // between poses too: a limit may be crossed there
    for (let i = 0; i <= (service.frames - 1) * fine; i++) {
      const here = zone(limits, at(service.distance, i / fine));
      const seconds = this.seconds(i / fine);
      const open = spans[spans.length - 1];
      if (open?.zone === here) open.to = seconds;
      else {
        if (open) open.to = seconds;
        spans.push({ zone: here, from: seconds, to: seconds });
      }
    }
    let path = "";
    for (const { zone: k, from, to } of spans) {
      const [x, end, y] = [this.x(from), this.x(to), 6 + 23 * k];
      draw(svg, "rect", { class: "here", x, y, width: Math.max(end - x, 1), height: 19 });
      path += `${path ? "L" : "M"}${x} ${y + 9.5}L${end} ${y + 9.5}`;
    }
    draw(svg, "path", { class: "step", d: path });
    this.axis(svg, high);
    const said = spans.map((s) => `${ZONES[s.zone]!} from ${s.from.toFixed(1)} s`);
    svg.setAttribute("aria-label", `Zones: ${said.join(", ")}.`);
  }

  private drawIssues(service: Service, { svg, high }: Plot): void {
    const said: string[] = [];
    this.data.issues.forEach((name, k) => {
      const { y } = this.lane(svg, k, capital(name));
      const [met, time] = [service.packed.issues[k], service.packed.times[k]];
      const end = this.x(service.seconds);
      if (time != null) {
        const x = Math.min(this.x(time), RIGHT - 6);
        draw(svg, "rect", { class: "met", x, y, width: Math.max(end - x, 6), height: 19 });
        const after = Math.max(end, x + 6) + 5;
        const fits = after < RIGHT - 66;
        const place: Attributes = fits ? { x: after } : { x: x - 5, "text-anchor": "end" };
        draw(svg, "text", { ...place, y: y + 14, class: "strong" }, `yes, ${time.toFixed(1)} s`);
      } else {
        const word = met === null ? "does not apply" : `no${graded(met!)}`;
        const fits = end < RIGHT - 108;
        const line = { x1: LEFT, x2: fits ? end : end - 110, y1: y + 9.5, y2: y + 9.5 };
        if (met === null) draw(svg, "line", { class: "void", ...line });
        const place: Attributes = fits ? { x: end + 5 } : { x: end - 5, "text-anchor": "end" };
        draw(svg, "text", { ...place, y: y + 14 }, word);
      }
      said.push(`${name} ${issueNow(service, k, Infinity, true)}`);
    });
    draw(svg, "line", {
      class: "rule", x1: this.x(service.seconds), x2: this.x(service.seconds), y1: 4, y2: high - 20,
    }); // prettier-ignore
    this.axis(svg, high);
    svg.setAttribute("aria-label", `Issues: ${said.join("; ")}.`);
  }
}
