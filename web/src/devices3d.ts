// Frusta of the devices and the light sheet of one projected line, as three.js objects.
import {
  BufferAttribute, BufferGeometry, CanvasTexture, DoubleSide, Group, LineBasicMaterial, LineSegments,
  Mesh, MeshBasicMaterial, SRGBColorSpace, Sprite, SpriteMaterial,
} from 'three';
import type {RigJson} from './data';
import {Device} from './device';
import {css, lightColor, type Rgb} from './palette';

const hex = ([r, g, b]: Rgb): number => (r << 16) | (g << 8) | b;

function painted(canvas: HTMLCanvasElement): CanvasTexture {
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace; // as canvases are
  return texture;
}

function label(text: string, color: string): Sprite {
  const canvas = document.createElement('canvas');
  const context = canvas.getContext('2d')!;
  const font = '600 26px system-ui, sans-serif'; // about twice its size on the screen
  context.font = font;
  canvas.width = Math.ceil(context.measureText(text).width) + 10;
  canvas.height = 36;
  context.font = font;
  context.fillStyle = color;
  context.textBaseline = 'middle';
  context.fillText(text, 5, 18);
  const material = new SpriteMaterial({
    map: painted(canvas), sizeAttenuation: false, depthTest: false, transparent: true});
  const sprite = new Sprite(material);
  const height = 0.026;
  sprite.scale.set((height * canvas.width) / canvas.height, height, 1);
  sprite.center.set(0.5, -0.2);
  return sprite;
}

function frustum(device: Device, size: number, color: number): LineSegments {
  const c = device.center;
  const corners = [[-0.5, -0.5], [device.width - 0.5, -0.5],
    [device.width - 0.5, device.height - 0.5], [-0.5, device.height - 0.5]]
    .map(([u, v]) => device.direction(u, v).map((d, k) => c[k] + size * d));
  const segments: number[] = [];
  corners.forEach((corner, i) => {
    segments.push(...c, ...corner, ...corner, ...corners[(i + 1) % 4]);
  });
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(new Float32Array(segments), 3));
  return new LineSegments(geometry, new LineBasicMaterial({color}));
}

/** All frusta with names. ink: of cameras, "#rrggbb"; of projectors, whose light is not known, too. */
export function drawDevices(rig: RigJson, ink: string, projectorInk?: Rgb): Group {
  const group = new Group();
  const center = rig.volume.center;
  const add = (device: Device, color: Rgb | null) => {
    const away = Math.hypot(...device.center.map((x, k) => x - center[k]));
    group.add(frustum(device, 0.13 * away, color ? hex(color) : parseInt(ink.slice(1), 16)));
    const name = label(device.name, color ? css(color) : ink);
    name.position.set(...device.center);
    group.add(name);
  };
  for (const camera of rig.cameras) add(new Device(camera), null);
  rig.projectors.forEach((projector, p) =>
    add(new Device(projector), projectorInk ?? lightColor(rig.patterns[p]?.[0]?.colors[0])));
  return group;
}

/** Where a line leaves the projector: unit directions along it. */
export function lineDirections(rig: RigJson, projector: number, pattern: number, line: number) {
  const device = new Device(rig.projectors[projector]);
  const {vertical, offset_px, pitch_px} = rig.patterns[projector][pattern];
  const at = offset_px + line * pitch_px;
  const length = (vertical ? device.height : device.width) - 1;
  const steps = 32;
  return Array.from({length: steps + 1}, (_, i) => {
    const along = (length * i) / steps;
    return vertical ? device.direction(at, along) : device.direction(along, at);
  });
}

/** The sheet of light of one line, from the projector to behind the object. */
export function drawSheet(rig: RigJson, projector: number, pattern: number, line: number): Group {
  const group = new Group();
  const info = rig.patterns[projector]?.[pattern];
  if (!info) return group;
  const center = new Device(rig.projectors[projector]).center;
  const middle = rig.volume.center;
  const reach = Math.hypot(...center.map((x, k) => x - middle[k])) + rig.volume.radius;
  const rim = lineDirections(rig, projector, pattern, line)
    .map((d) => d.map((x, k) => center[k] + reach * x));
  const triangles: number[] = [];
  for (let i = 0; i + 1 < rim.length; ++i) triangles.push(...center, ...rim[i], ...rim[i + 1]);
  const color = hex(lightColor(info.colors[info.sequence[line % info.sequence.length]]));
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(new Float32Array(triangles), 3));
  group.add(new Mesh(geometry, new MeshBasicMaterial({
    color, transparent: true, opacity: 0.1, side: DoubleSide, depthWrite: false})));
  const edges = [...center, ...rim[0], ...center, ...rim[rim.length - 1]];
  for (let i = 0; i + 1 < rim.length; ++i) edges.push(...rim[i], ...rim[i + 1]);
  const outline = new BufferGeometry();
  outline.setAttribute('position', new BufferAttribute(new Float32Array(edges), 3));
  group.add(new LineSegments(outline, new LineBasicMaterial({color, transparent: true, opacity: 0.6})));
  return group;
}

/** A marker that keeps its size on the screen and shows through the surface. */
export function drawMarker(color: string): Sprite {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = 64;
  const context = canvas.getContext('2d')!;
  context.lineWidth = 7;
  context.strokeStyle = '#000a';
  context.beginPath();
  context.arc(32, 32, 22, 0, 7);
  context.stroke();
  context.lineWidth = 4;
  context.strokeStyle = color;
  context.stroke();
  context.fillStyle = color;
  context.beginPath();
  context.arc(32, 32, 5, 0, 7);
  context.fill();
  const sprite = new Sprite(new SpriteMaterial({
    map: painted(canvas), sizeAttenuation: false, depthTest: false, transparent: true}));
  sprite.scale.set(0.032, 0.032, 1);
  return sprite;
}

export function drawSegments(positions: number[], color: number): LineSegments {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(new Float32Array(positions), 3));
  return new LineSegments(geometry,
    new LineBasicMaterial({color, depthTest: false, transparent: true}));
}

/** Frees what the graphics card holds of a group, and empties it. */
export function clear(group: Group): void {
  group.traverse((object) => {
    const drawn = object as Mesh;
    drawn.geometry?.dispose();
    const material = drawn.material as MeshBasicMaterial | undefined;
    material?.map?.dispose();
    material?.dispose();
  });
  group.clear();
}
