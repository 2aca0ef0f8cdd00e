// Shapes as instances: all boxes of a body are one draw call, and so on. The shader computes light as
// MuJoCo's renderer does, so that the page looks like its pictures.

import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  CylinderGeometry,
  DoubleSide,
  FrontSide,
  Group,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Mesh,
  PlaneGeometry,
  ShaderMaterial,
  SphereGeometry,
  type Texture,
  Vector3,
} from "three";
import type { Lights, Parts, Surface } from "./data";

const VERTEX = `
attribute float shift;
attribute vec3 place;
attribute vec4 turn;
attribute vec3 span;
attribute float lift;
attribute vec4 tint;
attribute vec3 finish;
varying vec3 vWorld;
varying vec3 vNormal;
varying vec4 vTint;
varying vec3 vFinish;
varying vec2 vAt;
uniform float repeat;
vec3 turned(vec4 q, vec3 v) { return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v); }
void main() {
  vec3 local = position * span + vec3(0.0, 0.0, shift * lift);
  // corners that should coincide do, so that nothing shines through between boxes that touch
  vec4 world = modelMatrix * vec4(floor((turned(turn, local) + place) * 8192.0 + 0.5) / 8192.0, 1.0);
  vWorld = world.xyz;
  vNormal = mat3(modelMatrix) * turned(turn, normalize(normal / span));
  vTint = tint;
  vFinish = finish;
  vAt = repeat > 0.0 ? local.xy * repeat : position.xy * 0.5 + 0.5;
  gl_Position = projectionMatrix * viewMatrix * world;
}`;

const FRAGMENT = `
uniform vec3 ambient;
uniform vec3 towards[3];
uniform vec3 diffuse[3];
uniform vec3 gleam[3];
uniform sampler2D picture;
uniform float pictured;
varying vec3 vWorld;
varying vec3 vNormal;
varying vec4 vTint;
varying vec3 vFinish;
varying vec2 vAt;
void main() {
  vec3 n = normalize(vNormal);
  vec3 eye = normalize(cameraPosition - vWorld);
  vec3 light = ambient + vec3(vFinish.x);
  vec3 shine = vec3(0.0);
  for (int k = 0; k < 3; k++) {
    float facing = dot(n, towards[k]);
    if (facing > 0.0) {
      light += facing * diffuse[k];
      shine += pow(max(dot(n, normalize(towards[k] + eye)), 0.0), 128.0 * vFinish.z) * gleam[k];
    }
  }
  // light is cut off before a picture is laid over it, as OpenGL once did
  gl_FragColor = vec4(min(vTint.rgb * light + vFinish.y * shine, 1.0), vTint.a);
  if (pictured > 0.5) gl_FragColor *= texture2D(picture, vAt);
}`;

/** Light that all shapes share; the first one goes with the camera. */
export class Lamps {
  readonly uniforms;

  constructor(lights: Lights) {
    const vector = (v: number[]) => new Vector3(v[0], v[1], v[2]);
    const away = (v: number[]) => vector(v).negate().normalize();
    this.uniforms = {
      ambient: { value: vector(lights.ambient) },
      towards: { value: [new Vector3(0, 0, 1), ...lights.lamps.map((lamp) => away(lamp[0]))] },
      diffuse: { value: [vector(lights.head[0]), ...lights.lamps.map((lamp) => vector(lamp[1]))] },
      gleam: { value: [vector(lights.head[1]), ...lights.lamps.map((lamp) => vector(lamp[2]))] },
    };
  }

  /** Turn the light of the camera; `back` points from what is seen to the camera. */
  follow(back: Vector3): void {
    this.uniforms.towards.value[0]!.copy(back);
  }
}

export interface Palette {
  surfaces: Surface[];
  pictures: Map<number, Texture>;
  lamps: Lamps;
}

/** A shape of a body: which part of which list, its colour, and where its body is. */
export interface Item {
  parts: Parts;
  index: number;
  colour: string;
  x?: number;
  y?: number;
  heading?: number;
}

const SMALL = 0.05; // metres; smaller things have fewer facets

function sphere(around: number, high: number, rod: boolean): BufferGeometry {
  const shape = new SphereGeometry(1, around, high);
  shape.rotateX(Math.PI / 2); // poles along z, as the ends of a rod
  return shifted(shape, rod);
}

/** Marks which end of a rod a corner belongs to; the ring between both ends is stretched. */
function shifted(shape: BufferGeometry, rod: boolean): BufferGeometry {
  const z = shape.getAttribute("position");
  const shift = new Float32Array(z.count);
  if (rod) for (let i = 0; i < z.count; i++) shift[i] = Math.sign(Math.round(1e4 * z.getZ(i)));
  shape.setAttribute("shift", new BufferAttribute(shift, 1));
  shape.deleteAttribute("uv");
  return shape;
}

const bases = new Map<string, BufferGeometry>();

function base(kind: string, small: boolean): BufferGeometry {
  const name = small ? `small ${kind}` : kind;
  let shape = bases.get(name);
  if (!shape) {
    if (kind === "box") shape = shifted(new BoxGeometry(2, 2, 2), false);
    else if (kind === "plane") shape = shifted(new PlaneGeometry(2, 2), false);
    else if (kind === "disc") {
      const upright = new CylinderGeometry(1, 1, 2, small ? 10 : 24);
      shape = shifted(upright.rotateX(Math.PI / 2), false);
    } else shape = sphere(small ? 8 : 16, small ? 5 : 9, kind === "rod");
    bases.set(name, shape);
  }
  return shape;
}

/** Meshes of these shapes. `dispose` them with the group when they are replaced. */
export function meshes(palette: Palette, items: Item[], kinds: string[]): Group {
  const sorted = new Map<string, Item[]>();
  for (const item of items) {
    const { parts, index } = item;
    const surface = parts.surface[index]!;
    const picture = palette.surfaces[surface]!.picture !== undefined;
    let kind = kinds[parts.kind[index]!]!;
    if (picture && kind === "box") kind = "plane"; // a soft spot that lies flat
    const size = parts.size.slice(3 * index, 3 * index + 3);
    const small = Math.max(...size) < SMALL || (kind === "rod" && size[0]! < SMALL);
    const key = `${kind}|${small ? 1 : 0}|${picture ? surface : -1}`;
    const there = sorted.get(key);
    if (there) there.push(item);
    else sorted.set(key, [item]);
  }
  const group = new Group();
  for (const [key, several] of sorted) {
    const [kind, small, surface] = key.split("|") as [string, string, string];
    group.add(mesh(palette, several, kind, small === "1", Number(surface)));
  }
  return group;
}

function mesh(palette: Palette, items: Item[], kind: string, small: boolean, surface: number): Mesh {
  const from = base(kind, small);
  const shape = new InstancedBufferGeometry();
  // copies: what is disposed of with one service must not be missing in the next
  shape.index = from.index!.clone();
  for (const name of ["position", "normal", "shift"]) shape.setAttribute(name, from.getAttribute(name).clone());
  shape.instanceCount = items.length;
  const columns = { place: 3, turn: 4, span: 3, lift: 1, tint: 4, finish: 3 };
  const values = Object.fromEntries(
    Object.entries(columns).map(([name, wide]) => [name, new Float32Array(wide * items.length)]),
  ) as Record<keyof typeof columns, Float32Array>;
  items.forEach((item, i) => fill(values, i, item, kind, palette.surfaces));
  for (const [name, wide] of Object.entries(columns)) {
    const column = values[name as keyof typeof columns];
    shape.setAttribute(name, new InstancedBufferAttribute(column, wide));
  }
  const picture = palette.pictures.get(surface);
  const soft = kind === "plane" && !palette.surfaces[surface]?.repeat;
  const material = new ShaderMaterial({
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: {
      ...palette.lamps.uniforms,
      picture: { value: picture ?? null },
      pictured: { value: picture ? 1 : 0 },
      repeat: { value: palette.surfaces[surface]?.repeat ?? 0 },
    },
    transparent: soft,
    depthWrite: !soft,
    side: soft ? DoubleSide : FrontSide,
  });
  const made = new Mesh(shape, material);
  made.frustumCulled = false; // its instances lie anywhere
  made.renderOrder = soft ? 1 : 0;
  return made;
}

function fill(
  to: Record<"place" | "turn" | "span" | "lift" | "tint" | "finish", Float32Array>,
  i: number,
  item: Item,
  kind: string,
  surfaces: Surface[],
): void {
  const { parts, index, colour, x = 0, y = 0, heading = 0 } = item;
  const [px, py, pz] = parts.place.slice(3 * index, 3 * index + 3) as [number, number, number];
  const [w, a, b, c] = parts.turn.slice(4 * index, 4 * index + 4) as [number, number, number, number];
  const [sx, sy, sz] = parts.size.slice(3 * index, 3 * index + 3) as [number, number, number];
  const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
  to.place.set([x + cos * px - sin * py, y + sin * px + cos * py, pz], 3 * i);
  // the heading's turn about z, then the part's own
  const [hw, hz] = [Math.cos(heading / 2), Math.sin(heading / 2)];
  to.turn.set([hw * a - hz * b, hw * b + hz * a, hw * c + hz * w, hw * w - hz * c], 4 * i);
  if (kind === "disc") to.span.set([sx, sx, sy], 3 * i);
  else if (kind === "rod") to.span.set([sx, sx, sx], 3 * i);
  else if (kind === "plane") to.span.set([sx, sy, 1], 3 * i);
  else to.span.set([sx, sy, sz], 3 * i);
  to.lift[i] = kind === "rod" ? sy : 0;
  for (let k = 0; k < 4; k++) to.tint[4 * i + k] = parseInt(colour.slice(2 * k, 2 * k + 2), 16) / 255;
  const surface = surfaces[parts.surface[index]!]!;
  to.finish.set([surface.emission, surface.specular, surface.shininess], 3 * i);
}

export function dispose(group: Group): void {
  for (const child of group.children as Mesh[]) {
    child.geometry.dispose();
    (child.material as ShaderMaterial).dispose();
  }
}
