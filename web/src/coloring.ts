// Colours of points and vertices by what is known of them, and the legend that explains them.
import type {Mesh, Points, RigJson} from './data';
import {kFigures} from './figure_text';
import {nearestVertices} from './nearest';
import {category, diverging, kHoles, lightColor, sequential, type Named, type Rgb} from './palette';

export type ColorMode =
  'shading' | 'albedo' | 'camera' | 'projector' | 'line' | 'sigma' | 'confidence' | 'hole' | 'distance' |
  'difference';

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
  {value: 'difference', text: 'Difference of frames'},
];

export interface Legend {
  title: string;
  named?: Named[];
  scale?: Scaled;
  unit?: string;
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

/** The next larger one of 1, 2, 5, 10, ... */
function niceStep(value: number): number {
  const unit = 10 ** Math.floor(Math.log10(value));
  return unit * ([1, 2, 5].find((step) => value <= step * unit * 1.0001) ?? 10);
}

const colorAt = (color: Uint8Array, i: number): Rgb =>
  [color[3 * i], color[3 * i + 1], color[3 * i + 2]];

export interface Range {
  low: number;
  high: number;
}

/** Colour modes with a scale. */
export type Scaled = 'sigma' | 'confidence' | 'distance' | 'difference';
export type Ranges = Record<Scaled, Range>;
export const isScaled = (mode: ColorMode): mode is Scaled =>
  ['sigma', 'confidence', 'distance', 'difference'].includes(mode);

/** What nearly all of the values are within (outliers do not spoil it), in round numbers. */
export function fitted(lists: (Float32Array | undefined)[], symmetric = false): Range {
  const known = lists.filter((list): list is Float32Array => list !== undefined && list.length > 0);
  if (!known.length) return {low: 0, high: 1};
  let low = Math.min(...known.map((list) => quantile(list, 0.05)));
  let high = Math.max(...known.map((list) => quantile(list, 0.95)));
  if (symmetric) low = -(high = Math.max(Math.abs(low), Math.abs(high)));
  if (!(high > low)) [low, high] = [low - 0.05 * (Math.abs(low) || 1), high + 0.05 * (Math.abs(high) || 1)];
  const step = niceStep((high - low) / 20);
  const round = (value: number) => Number(value.toPrecision(6)); // 0.30000000000000004
  return {low: round(Math.floor(low / step + 1e-6) * step), high: round(Math.ceil(high / step - 1e-6) * step)};
}

const shares = (bytes: Uint8Array | undefined): Float32Array | undefined =>
  bytes && Float32Array.from(bytes, (byte) => byte / 255);

/** Vertices that close the surface where nobody measured. */
const isClosing = (mesh: Mesh, i: number): boolean =>
  (mesh.confidence !== undefined && mesh.confidence[i] === 0) ||
  (mesh.hole !== undefined && mesh.hole[i] !== 1);

const measured = (mesh: Mesh, values: Float32Array | undefined): Float32Array | undefined =>
  values?.filter((_, i) => !isClosing(mesh, i));

/** Of what is known of points and surface together. */
export function fittedRange(mode: Scaled, points: Points | null, mesh: Mesh | null): Range {
  switch (mode) {
    case 'sigma': return fitted([points?.sigma, mesh ? measured(mesh, mesh.sigma) : undefined]);
    case 'confidence': return fitted([shares(points?.confidence), mesh ? measured(mesh, shares(mesh.confidence)) : undefined]);
    case 'distance': return fitted([points?.distance, mesh?.distance]);
    case 'difference': return fitted([mesh?.difference], true);
  }
}

/** Where a value lies in its scale, as a colour. */
export function scaled(mode: Scaled, value: number, {low, high}: Range): Rgb {
  const share = (value - low) / (high - low);
  return mode === 'difference' ? diverging(2 * share - 1) : sequential(share);
}

/** mesh: of which the points take their albedo. */
export function colorPoints(
  points: Points, mesh: Mesh | null, mode: ColorMode, rig: RigJson | null, ranges: Ranges, plain: Rgb,
): Float32Array {
  const {count} = points;
  switch (mode) {
    case 'camera': return paint(count, (i) => category(points.camera[i]));
    case 'projector': return paint(count, (i) => category(points.projector[i]));
    case 'line': return paint(count, (i) => {
      const pattern = rig?.patterns[points.projector[i]]?.[points.pattern[i]];
      if (!pattern) return plain;
      return lightColor(pattern.colors[pattern.sequence[points.line[i] % pattern.sequence.length]]);
    });
    case 'sigma': return paint(count, (i) => scaled('sigma', points.sigma[i], ranges.sigma));
    case 'confidence': return paint(count, (i) => scaled('confidence', points.confidence[i] / 255, ranges.confidence));
    case 'distance':
      return points.distance
        ? paint(count, (i) => scaled('distance', points.distance![i], ranges.distance))
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
  mesh: Mesh, mode: ColorMode, ranges: Ranges, clay: Rgb, invented: Rgb,
): Float32Array {
  const count = mesh.position.length / 3;
  const closing = (i: number) => isClosing(mesh, i);
  if (mode === 'sigma' && mesh.sigma) {
    return paint(count, (i) => closing(i) ? invented : scaled('sigma', mesh.sigma![i], ranges.sigma));
  }
  if (mode === 'confidence' && mesh.confidence) {
    return paint(count, (i) => scaled('confidence', mesh.confidence![i] / 255, ranges.confidence));
  }
  if (mode === 'hole' && mesh.hole) {
    return paint(count, (i) => (kHoles[mesh.hole![i]] ?? kHoles[0]).color);
  }
  if (mode === 'distance' && mesh.distance) {
    return paint(count, (i) => scaled('distance', mesh.distance![i], ranges.distance));
  }
  if (mode === 'difference' && mesh.difference) {
    return paint(count, (i) => scaled('difference', mesh.difference![i], ranges.difference));
  }
  if (mode === 'albedo' && mesh.color) return paint(count, (i) => colorAt(mesh.color!, i));
  return paint(count, (i) => closing(i) ? invented : clay);
}

export function legendOf(
  mode: ColorMode, rig: RigJson | null, mesh: Mesh | null, clay: Rgb, invented: Rgb,
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
    case 'confidence': return {title: 'Confidence', scale: mode, unit: ''};
    case 'sigma':
    case 'distance':
    case 'difference': return {title: kFigures[mode].name, scale: mode, unit};
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
