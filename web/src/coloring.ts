// Colours of points and vertices by what is known of them, and the legend that explains them.
import type {Mesh, Points, RigJson} from './data';
import {nearestVertices} from './nearest';
import {category, kHoles, lightColor, sequential, type Named, type Rgb} from './palette';

export type ColorMode =
  'shading' | 'albedo' | 'camera' | 'projector' | 'line' | 'sigma' | 'confidence' | 'hole' | 'distance';

export const kColorModes: {value: ColorMode; text: string}[] = [
  {value: 'shading', text: 'Shading'},
  {value: 'albedo', text: 'Albedo'},
  {value: 'camera', text: 'Camera'},
  {value: 'projector', text: 'Projector'},
  {value: 'line', text: 'Line colour'},
  {value: 'sigma', text: 'Sigma'},
  {value: 'confidence', text: 'Confidence'},
  {value: 'hole', text: 'Hole reason'},
  {value: 'distance', text: 'Distance to truth'},
];

export interface Legend {
  title: string;
  named?: Named[];
  range?: {low: number; high: number; unit: string};
}

const toLinear = new Float32Array(256);
for (let i = 0; i < 256; ++i) {
  const s = i / 255;
  toLinear[i] = s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4;
}

/** Linear RGB floats, as three.js wants vertex colours. */
export function paint(count: number, colorOf: (i: number) => Rgb): Float32Array {
  const colors = new Float32Array(3 * count);
  for (let i = 0; i < count; ++i) {
    const [r, g, b] = colorOf(i);
    colors[3 * i] = toLinear[r];
    colors[3 * i + 1] = toLinear[g];
    colors[3 * i + 2] = toLinear[b];
  }
  return colors;
}

/** What is below `share` of the values; for scales that outliers do not spoil. */
function quantile(values: Float32Array, share: number): number {
  const stride = Math.max(1, Math.floor(values.length / 20000));
  const sample: number[] = [];
  for (let i = 0; i < values.length; i += stride) {
    if (Number.isFinite(values[i])) sample.push(values[i]);
  }
  sample.sort((a, b) => a - b);
  return sample.length ? sample[Math.floor(share * (sample.length - 1))] : 1;
}

function niceHigh(value: number): number {
  if (!(value > 0)) return 1;
  const unit = 10 ** Math.floor(Math.log10(value));
  for (const step of [1, 1.5, 2, 3, 4, 5, 6, 8, 10]) {
    if (value <= step * unit) return step * unit;
  }
  return 10 * unit;
}

const colorAt = (color: Uint8Array, i: number): Rgb =>
  [color[3 * i], color[3 * i + 1], color[3 * i + 2]];

/** The high end of a scale that both points and mesh share. */
export function scaleOf(...lists: (Float32Array | undefined)[]): number {
  return niceHigh(Math.max(0, ...lists.filter((l) => l?.length).map((l) => quantile(l!, 0.95))));
}

export interface Ramps {
  sigma: number;
  distance: number;
}

/** mesh: of which the points take their albedo. */
export function colorPoints(
  points: Points, mesh: Mesh | null, mode: ColorMode, rig: RigJson | null, ramps: Ramps, plain: Rgb,
): Float32Array {
  const {count} = points;
  const byConfidence = (i: number) => sequential(points.confidence[i] / 255);
  switch (mode) {
    case 'camera': return paint(count, (i) => category(points.camera[i]));
    case 'projector': return paint(count, (i) => category(points.projector[i]));
    case 'line': return paint(count, (i) => {
      const pattern = rig?.patterns[points.projector[i]]?.[points.pattern[i]];
      if (!pattern) return plain;
      return lightColor(pattern.colors[pattern.sequence[points.line[i] % pattern.sequence.length]]);
    });
    case 'sigma': return paint(count, (i) => sequential(points.sigma[i] / ramps.sigma));
    case 'confidence': return paint(count, byConfidence);
    case 'distance':
      return points.distance
        ? paint(count, (i) => sequential(points.distance![i] / ramps.distance))
        : paint(count, () => plain);
    case 'albedo': {
      const color = mesh?.color;
      if (!color) return paint(count, () => plain);
      const vertex = nearestVertices(mesh.position, points.position);
      return paint(count, (i) => vertex[i] < 0 ? plain : colorAt(color, vertex[i]));
    }
    default: return paint(count, () => plain);
  }
}

export function colorMesh(
  mesh: Mesh, mode: ColorMode, ramps: Ramps, clay: Rgb, invented: Rgb,
): Float32Array {
  const count = mesh.position.length / 3;
  const closing = (i: number) =>
    (mesh.confidence !== undefined && mesh.confidence[i] === 0) ||
    (mesh.hole !== undefined && mesh.hole[i] !== 1);
  if (mode === 'sigma' && mesh.sigma) {
    return paint(count, (i) => closing(i) ? invented : sequential(mesh.sigma![i] / ramps.sigma));
  }
  if (mode === 'confidence' && mesh.confidence) {
    return paint(count, (i) => sequential(mesh.confidence![i] / 255));
  }
  if (mode === 'hole' && mesh.hole) {
    return paint(count, (i) => (kHoles[mesh.hole![i]] ?? kHoles[0]).color);
  }
  if (mode === 'distance' && mesh.distance) {
    return paint(count, (i) => sequential(mesh.distance![i] / ramps.distance));
  }
  if (mode === 'albedo' && mesh.color) return paint(count, (i) => colorAt(mesh.color!, i));
  return paint(count, (i) => closing(i) ? invented : clay);
}

export function legendOf(
  mode: ColorMode, rig: RigJson | null, mesh: Mesh | null, ramps: Ramps, clay: Rgb, invented: Rgb,
): Legend | null {
  const unit = rig?.unit ?? 'mm';
  const devices = (list: {name: string}[] | undefined) =>
    (list ?? []).map((device, i) => ({name: device.name, color: category(i)}));
  switch (mode) {
    case 'camera': return {title: 'Camera', named: devices(rig?.cameras)};
    case 'projector': return {title: 'Projector', named: devices(rig?.projectors)};
    case 'line': {
      const names = new Set((rig?.patterns ?? []).flat().flatMap((p) => p.colors));
      return {title: 'Colour of the projected line',
        named: [...names].map((name) => ({name, color: lightColor(name)}))};
    }
    case 'sigma': return {title: 'Sigma', range: {low: 0, high: ramps.sigma, unit}};
    case 'confidence': return {title: 'Confidence', range: {low: 0, high: 1, unit: ''}};
    case 'distance': return {title: 'Distance to truth', range: {low: 0, high: ramps.distance, unit}};
    case 'albedo': return {title: 'Albedo, up to one common factor', named: []};
    case 'hole': {
      const present = new Set(mesh?.hole ?? []);
      return {title: 'Why not measured', named: kHoles.filter((_, i) => present.has(i))};
    }
    default:
      return mesh?.confidence || mesh?.hole
        ? {title: 'Surface', named: [
          {name: 'measured', color: clay}, {name: 'closed without measurement', color: invented}]}
        : null;
  }
}
