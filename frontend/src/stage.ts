// The picture: the restaurant in WebGL, and four cameras. Axes are MuJoCo's, z points up.

import {
  BufferGeometry,
  Color,
  ColorManagement,
  DoubleSide,
  Float32BufferAttribute,
  Group,
  LinearFilter,
  LinearSRGBColorSpace,
  Mesh,
  MeshBasicMaterial,
  PerspectiveCamera,
  Quaternion,
  RepeatWrapping,
  RingGeometry,
  Scene,
  Spherical,
  Texture,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { at, type Payload, type Service } from "./data";
import { dispose, type Item, Lamps, meshes, type Palette } from "./shapes";

export const CAMERAS = ["room", "robot", "guest", "free"] as const;
export type Camera = (typeof CAMERAS)[number];

const ASPECT = 4 / 3; // that cameras are made for; a narrower picture sees as far to the sides
const UP = new Vector3(0, 0, 1);

export class Stage {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly eye = new PerspectiveCamera(40, ASPECT, 0.15, 120);
  private readonly palette: Palette;
  private readonly indoors: Group;
  private readonly robot: Group;
  private readonly rings: Group;
  private readonly orbit: OrbitControls;
  private guests = new Group();
  private faces = new Group();
  private service: Service | null = null;
  private position = 0;
  private camera: Camera = "room";
  private waiting = false;

  constructor(
    private readonly data: Payload,
    private readonly canvas: HTMLCanvasElement,
    context: WebGL2RenderingContext,
  ) {
    ColorManagement.enabled = false; // colours and light are as in MuJoCo's pictures, as they are
    this.renderer = new WebGLRenderer({ canvas, context, antialias: true });
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    const { scene } = data;
    this.palette = { surfaces: scene.surfaces, pictures: this.pictures(), lamps: new Lamps(scene.lights) };
    const room = whole(scene.room, scene.room.colour);
    const hidden = (item: Item) => item.parts.indoors[item.index] === 1;
    const made = (items: Item[]) => meshes(this.palette, items, scene.kinds);
    this.indoors = made(room.filter(hidden));
    this.robot = made(whole(scene.robot, scene.robot.colour));
    this.rings = rings(data.limits);
    this.scene.background = new Color(0.79, 0.765, 0.72);
    this.scene.add(made(room.filter((item) => !hidden(item))), this.indoors, this.robot, this.rings);
    this.eye.up.copy(UP);
    this.orbit = new OrbitControls(this.eye, canvas);
    Object.assign(this.orbit, { minDistance: 1, maxDistance: 34, maxPolarAngle: 1.52 });
    this.orbit.addEventListener("change", () => this.ask());
    this.view("room");
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
    this.resize();
  }

  /** Put the people of a service in their places. */
  show(service: Service): void {
    for (const group of [this.guests, this.faces]) {
      this.scene.remove(group);
      dispose(group);
    }
    const { figures, coats, colours, scene } = this.data;
    const items = service.guests.flatMap(({ x, y, facing }, g) => {
      const coat = coats[service.packed.coat[g]!]!.map((k) => colours[k]!);
      return whole(figures[service.packed.shape[g]!]!, coat, x, y, facing);
    });
    const small = (item: Item) => item.parts.indoors[item.index] === 1;
    this.guests = meshes(this.palette, items.filter((item) => !small(item)), scene.kinds);
    this.faces = meshes(this.palette, items.filter(small), scene.kinds);
    this.scene.add(this.guests, this.faces);
    this.rings.position.set(service.guests[0]!.x, service.guests[0]!.y, 0);
    this.service = service;
    this.move(0);
    if (this.camera === "free") this.orbit.update();
  }

  /** Put the robot where it was, counted in poses. */
  move(position: number): void {
    this.position = position;
    const { service } = this;
    if (!service) return;
    this.robot.position.set(at(service.x, position), at(service.y, position), 0);
    this.robot.rotation.z = at(service.yaw, position);
    this.ask();
  }

  view(camera: Camera): void {
    if (camera === "free" && this.camera !== "free") this.release();
    this.camera = camera;
    const free = camera === "free";
    this.orbit.enabled = free;
    this.canvas.style.touchAction = free ? "none" : "auto";
    this.canvas.classList.toggle("free", free);
    this.resize();
  }

  showRings(visible: boolean): void {
    this.rings.visible = visible;
    this.ask();
  }

  /** Turn the free camera about what it looks at, radians, or go nearer by a factor. */
  turn(sideways: number, upwards: number, nearer = 1): void {
    const from = this.eye.position.clone().sub(this.orbit.target);
    // three's spherical coordinates have y up
    const way = new Spherical().setFromVector3(new Vector3(from.x, from.z, -from.y));
    way.theta += sideways;
    way.phi = Math.min(Math.max(way.phi - upwards, 0.05), this.orbit.maxPolarAngle);
    way.radius *= nearer;
    const to = new Vector3().setFromSpherical(way);
    this.eye.position.copy(this.orbit.target).add(new Vector3(to.x, -to.z, to.y));
    this.orbit.update();
    this.ask();
  }

  /** Draw soon; many wishes before the next frame are one. */
  ask(): void {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }

  private draw(): void {
    this.aim();
    const { x, y, z } = this.eye.position;
    const [wide, deep, high] = this.data.scene.room_size;
    this.indoors.visible = Math.abs(x) < wide && Math.abs(y) < deep && z < high;
    this.faces.visible = this.camera !== "room";
    this.eye.updateMatrixWorld();
    this.palette.lamps.follow(new Vector3(0, 0, 1).applyQuaternion(this.eye.quaternion));
    this.renderer.render(this.scene, this.eye);
  }

  private aim(): void {
    if (this.camera === "room") {
      const { place, turn } = pose(Float64Array.from(this.data.scene.room_view), 0);
      this.eye.position.copy(place);
      this.eye.quaternion.copy(turn);
    } else if (this.service && this.camera !== "free") {
      const shoulder = this.camera === "robot";
      const views = shoulder ? this.service.shoulder : this.service.beside;
      const last = views.length / 7 - 1;
      const here = Math.min(shoulder ? this.position : 0, last);
      const k = Math.floor(here);
      const [before, after] = [pose(views, k), pose(views, Math.min(k + 1, last))];
      this.eye.position.lerpVectors(before.place, after.place, here - k);
      this.eye.quaternion.slerpQuaternions(before.turn, after.turn, here - k);
    }
  }

  /** The free camera begins where the last one was, and turns about the one who asks. */
  private release(): void {
    this.aim();
    const asking = this.service?.guests[0] ?? { x: 0, y: 0 };
    this.orbit.target.set(asking.x, asking.y, 0.8);
    this.orbit.update();
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas.parentElement!;
    if (!clientWidth || !clientHeight) return;
    this.renderer.setSize(clientWidth, clientHeight, false);
    const aspect = clientWidth / clientHeight;
    const fovy = this.data.scene.fovy[this.camera] ?? 45;
    // the room fills the width of any picture; other cameras see more to the sides in a wide one
    const least = this.camera === "room" ? 0.8 : 1;
    const half = Math.tan((fovy * Math.PI) / 360) * Math.max(least, ASPECT / aspect);
    this.eye.fov = (2 * Math.atan(half) * 180) / Math.PI;
    this.eye.aspect = aspect;
    this.eye.near = this.camera === "room" ? 1 : 0.04; // cameras in the room may be close to a wall
    this.eye.updateProjectionMatrix();
    this.ask();
  }

  private pictures(): Map<number, Texture> {
    const made = new Map<number, Texture>();
    this.data.scene.surfaces.forEach((surface, k) => {
      if (!surface.picture) return;
      const image = new Image();
      const texture = new Texture(image);
      if (surface.repeat) texture.wrapS = texture.wrapT = RepeatWrapping;
      else texture.minFilter = LinearFilter;
      texture.anisotropy = 4;
      image.onload = () => {
        texture.needsUpdate = true;
        this.ask();
      };
      image.src = surface.picture;
      made.set(k, texture);
    });
    return made;
  }
}

function whole(parts: Item["parts"], colours: string[], x = 0, y = 0, heading = 0): Item[] {
  return colours.map((colour, index) => ({ parts, index, colour, x, y, heading }));
}

function pose(views: Float64Array, k: number): { place: Vector3; turn: Quaternion } {
  const [x, y, z, w, a, b, c] = views.slice(7 * k, 7 * k + 7);
  return { place: new Vector3(x, y, z), turn: new Quaternion(a, b, c, w).normalize() };
}

/** Where zones end: a whole line, dashes and dots, and a pale floor where a response is proper. */
function rings(limits: Payload["limits"]): Group {
  const group = new Group();
  const paint = (opacity: number, rgb: [number, number, number]) =>
    new MeshBasicMaterial({
      color: new Color(...rgb),
      transparent: true,
      opacity,
      depthWrite: false,
      side: DoubleSide,
    });
  const proper = new RingGeometry(limits.nearest, limits.farthest, 96);
  group.add(new Mesh(proper, paint(0.2, [0, 0.62, 0.45])));
  const ink = paint(0.85, [0.1, 0.13, 0.2]);
  group.add(new Mesh(circle(limits.risk, 1, 1), paint(0.95, [0.75, 0.25, 0])));
  group.add(new Mesh(circle(limits.nearest, 24, 0.62), ink));
  group.add(new Mesh(circle(limits.farthest, 72, 0.45), ink));
  group.children.forEach((child, k) => {
    child.position.z = 0.012 + 0.0005 * k;
    child.renderOrder = 3 + k;
  });
  return group;
}

function circle(radius: number, dashes: number, share: number): BufferGeometry {
  const corners: number[] = [];
  const steps = Math.max(2, Math.round(96 / dashes));
  for (let d = 0; d < dashes; d++) {
    for (let s = 0; s < steps; s++) {
      const [from, to] = [s, s + 1].map((k) => ((d + (share * k) / steps) * 2 * Math.PI) / dashes);
      const point = (r: number, a: number) => [r * Math.cos(a), r * Math.sin(a), 0];
      const [inner, outer] = [radius - 0.014, radius + 0.014];
      const [a, b, c, e] = [point(inner, from!), point(outer, from!), point(outer, to!), point(inner, to!)];
      corners.push(...a!, ...b!, ...c!, ...a!, ...c!, ...e!);
    }
  }
  return new BufferGeometry().setAttribute("position", new Float32BufferAttribute(corners, 3));
}
