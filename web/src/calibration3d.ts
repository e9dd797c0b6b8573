// The calibrated devices in space, with some of the points that placed them.
import type {DeviceJson, Vec3} from './device';
import {digList, digNumber, type Json, type RigJson} from './data';
import {drawDevices} from './devices3d';
import {format, h} from './dom';
import {css, type Rgb} from './palette';
import {Picture3d} from './scene';

type Numbers = number[];
const kProjector: Rgb = [214, 112, 20];

const isNumbers = (value: Json | undefined, length: number): value is Numbers =>
  Array.isArray(value) && value.length === length && value.every((x) => typeof x === 'number' && Number.isFinite(x));

/** A placed device of calibration.json, as those of rig.json are; null where a part is missing. */
function placedDevice(name: string, json: Json): DeviceJson | null {
  const R = digList(json, 'R');
  const t = digList(json, 't');
  const [fx, fy, cx, cy] = ['fx', 'fy', 'cx', 'cy'].map((key) => digNumber(json, 'parameters', key, 'value'));
  const [width, height] = [digNumber(json, 'width'), digNumber(json, 'height')];
  if (R.length !== 3 || !R.every((row) => isNumbers(row, 3)) || !isNumbers(t, 3)) return null;
  if (!fx || !fy || cx === undefined || cy === undefined || !width || !height) return null;
  return {name, width, height, K: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], distortion: [0, 0, 0, 0, 0],
    R: R as Numbers[], t};
}

const sub = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const centerOf = ({R, t}: DeviceJson): Vec3 =>
  [0, 1, 2].map((k) => -(R[0][k] * t[0] + R[1][k] * t[1] + R[2][k] * t[2])) as Vec3;
/** The ball around the box of some places. */
function around(places: Vec3[]): {center: Vec3; radius: number} {
  const side = (k: number) => {
    const values = places.map((p) => p[k]).sort((a, b) => a - b);
    return [values[0], values[values.length - 1]];
  };
  const sides = [0, 1, 2].map(side);
  return {center: sides.map(([low, high]) => (low + high) / 2) as Vec3,
    radius: Math.max(1e-9, Math.hypot(...sides.map(([low, high]) => high - low)) / 2)};
}

/** Without the far hundredth: a few wrong points must not make all others small. */
function trimmed(points: Vec3[]): Vec3[] {
  if (points.length < 50) return points;
  const middle = [0, 1, 2].map((k) => [...points].sort((a, b) => a[k] - b[k])[points.length >> 1][k]) as Vec3;
  const away = (p: Vec3) => Math.hypot(...sub(p, middle));
  return [...points].sort((a, b) => away(a) - away(b)).slice(0, Math.ceil(0.99 * points.length));
}

/** The picture, or null where nothing was placed. isProjector: by the device's name. */
export function devicesInSpace(
  devices: {name: string; json: Json}[], report: Json, isProjector: (name: string) => boolean, onTheme: (f: () => void) => void,
): HTMLElement | null {
  const placed = devices.map(({name, json}) => placedDevice(name, json)).filter((d) => d !== null);
  if (!placed.length) return null;
  const points = digList(report, 'points').filter((p): p is Numbers => isNumbers(p, 3)) as Vec3[];
  const centers = placed.map(centerOf);
  const near = trimmed(points);
  const all = around([...near, ...centers]);
  const middle = around(near.length ? near : centers).center;
  const rig: RigJson = {
    cameras: placed.filter(({name}) => !isProjector(name)),
    projectors: placed.filter(({name}) => isProjector(name)),
    patterns: [], families: [], unit: '', volume: {center: middle, radius: 0.3 * all.radius},
  };
  const holder = h('div', {class: 'canvas-holder space'});
  const words = `${placed.length} of ${devices.length} devices placed${points.length ? `, ${format(points.length)} of the surface points` : ''}`;
  const figure = h('figure', {class: 'chart'}, h('figcaption', {}, h('strong', {}, 'Devices in space'),
    ` ${words}; drag or use the arrow keys to turn it`), holder);
  let picture: Picture3d;
  try {
    picture = new Picture3d(holder);
  } catch (error) {
    holder.append(h('p', {class: 'overlay-message'}, `The 3-D picture needs WebGL, which this browser does not offer (${String(error)}).`));
    return figure;
  }
  picture.canvas.setAttribute('role', 'application');
  picture.canvas.setAttribute('aria-label', `Devices in space: ${words}. Arrow keys turn it, plus and minus zoom, 0 shows everything.`);
  // Up is what the cameras together hold to be up.
  const up = [0, 1, 2].map((k) => -rig.cameras.reduce((sum, d) => sum + d.R[1][k], 0)) as Vec3;
  // From behind the devices, aside and above.
  const average = [0, 1, 2].map((k) => centers.reduce((sum, c) => sum + c[k], 0) / centers.length - middle[k]) as Vec3;
  const far = Math.hypot(...average) > 0.2 * all.radius ? average : [1, -0.55, 0.4] as Vec3;
  const aside: Vec3 = [up[1] * far[2] - up[2] * far[1], up[2] * far[0] - up[0] * far[2], up[0] * far[1] - up[1] * far[0]];
  const length = Math.hypot(...up) || 1;
  const [a, u] = [0.9 / length, (0.5 * Math.hypot(...far)) / length];
  picture.setBounds(all.center, 0.8 * all.radius); // devices at the corners of their box are rare
  picture.setHome(up, [0, 1, 2].map((k) => far[k] + a * aside[k] + u * up[k]) as Vec3);
  picture.fit();
  picture.setPoints(points.length ? new Float32Array(points.flat()) : null);
  let drawn = drawDevices(rig, '#44525f', kProjector);
  const paint = () => {
    const style = getComputedStyle(document.documentElement);
    const [canvas, ink, point] = ['--canvas', '--ink-3d', '--point'].map((key) => style.getPropertyValue(key).trim());
    picture.setBackground(canvas);
    picture.helpers.remove(drawn);
    drawn = drawDevices(rig, ink, kProjector);
    picture.helpers.add(drawn);
    const rgb = [1, 3, 5].map((k) => parseInt(point.slice(k, k + 2), 16) / 255);
    picture.setColors('points', Float32Array.from({length: 3 * points.length}, (_, i) => rgb[i % 3]));
    picture.pointSize = 2 * Math.min(devicePixelRatio, 2);
  };
  paint();
  onTheme(paint);
  holder.append(h('div', {class: 'legend'}, h('span', {class: 'key'}, h('i', {style: 'background:var(--ink-3d)'}), 'camera'),
    h('span', {class: 'key'}, h('i', {style: `background:${css(kProjector)}`}), 'projector'),
    points.length ? h('span', {class: 'key'}, h('i', {style: 'background:var(--point)'}), 'surface point') : null));
  return figure;
}
