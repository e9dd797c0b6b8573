// What is drawn over a camera's picture: its curves in the colours of a layer, and crossings.
import type {App} from './app';
import type {Curves, DepthMap, Points} from './data';
import {h} from './dom';
import {lengthText, significant} from './figure_text';
import {category, css, kStates, kUndecided, lightColor, sequential, type Named, type Rgb} from './palette';

export type Layer = 'local' | 'projector' | 'color' | 'confidence' | 'undecided' | 'none';

export const kLayers: {value: Layer; text: string}[] = [
  {value: 'local', text: 'Local ID'},
  {value: 'projector', text: 'Projector'},
  {value: 'color', text: 'Code colour'},
  {value: 'confidence', text: 'Confidence'},
  {value: 'undecided', text: 'Undecided: why'},
  {value: 'none', text: 'No curves'},
];

export interface ColoredPath {
  color: Rgb;
  path: Path2D; // in pixels of the camera
}

const kConfidenceSteps = 8;
const confidenceKey = (byte: number) => Math.round((byte / 255) * (kConfidenceSteps - 1));

function keyOfCurvePoint(curves: Curves, i: number, layer: Layer): number {
  const labelled = curves.state[i] === 0;
  switch (layer) {
    case 'local': return curves.localId[i] === 255 ? -1 : curves.localId[i] % 8;
    case 'projector': return labelled ? curves.projector[i] % 8 : -1;
    case 'color': return curves.family[i] * 16 + curves.color[i];
    case 'confidence': return labelled ? confidenceKey(curves.confidence[i]) : -1;
    default: return curves.state[i];
  }
}

function colorOfKey(key: number, layer: Layer, app: App): Rgb {
  if (key < 0) return kUndecided;
  switch (layer) {
    case 'color': return lightColor(app.rig?.families[key >> 4]?.[key & 15]);
    case 'confidence': return sequential(key / (kConfidenceSteps - 1));
    case 'undecided': return (kStates[key] ?? kStates[0]).color;
    default: return category(key);
  }
}

/** One path per colour; few of them, because stroking is what takes the time. */
class Paths {
  private readonly byKey = new Map<number, Path2D>();

  of(key: number): Path2D {
    let path = this.byKey.get(key);
    if (!path) this.byKey.set(key, (path = new Path2D()));
    return path;
  }

  /** What is decided on top of what is not; reasons on top of what is labelled. */
  inOrder(layer: Layer, app: App): ColoredPath[] {
    return [...this.byKey].sort(([a], [b]) => a - b)
      .map(([key, path]) => ({color: colorOfKey(key, layer, app), path}));
  }
}

function pathsOfCurves(curves: Curves, camera: number, layer: Layer): Paths {
  const paths = new Paths();
  const end = curves.beginOfCamera[camera + 1] ?? curves.count;
  let last = -1; // key of the point before, on the same curve
  for (let i = curves.beginOfCamera[camera] ?? 0; i < end; ++i) {
    const key = keyOfCurvePoint(curves, i, layer);
    const path = paths.of(key);
    const joined = i > 0 && curves.curve[i - 1] === curves.curve[i] &&
      Math.abs(curves.u[i] - curves.u[i - 1]) + Math.abs(curves.v[i] - curves.v[i - 1]) < 6;
    if (!joined) path.moveTo(curves.u[i], curves.v[i]);
    else if (last !== key) path.moveTo(curves.u[i - 1], curves.v[i - 1]);
    path.lineTo(curves.u[i], curves.v[i]);
    last = key;
  }
  return paths;
}

/** Without curves.ply, the measured points alone. */
function pathsOfPoints(points: Points, camera: number, layer: Layer): Paths {
  const paths = new Paths();
  for (let i = 0; i < points.count; ++i) {
    if (points.camera[i] !== camera) continue;
    const key = layer === 'confidence' ? confidenceKey(points.confidence[i]) : points.projector[i] % 8;
    paths.of(key).rect(points.u[i] - 0.5, points.v[i] - 0.5, 1, 1);
  }
  return paths;
}

/** Curves of a camera, to be stroked; points, to be filled, where there are no curves. */
export function layerPaths(app: App, camera: number, layer: Layer): ColoredPath[] {
  if (layer === 'none') return [];
  if (app.curves) return pathsOfCurves(app.curves, camera, layer).inOrder(layer, app);
  // Points know neither colour nor state: they show their projector then.
  const shown = layer === 'confidence' ? layer : 'projector';
  return app.points ? pathsOfPoints(app.points, camera, shown).inOrder(shown, app) : [];
}

export function crossingsPath(curves: Curves | null, camera: number): Path2D | null {
  if (!curves) return null;
  const path = new Path2D();
  for (let i = 0; i < curves.crossingU.length; ++i) {
    if (curves.crossingCamera[i] !== camera) continue;
    const [u, v] = [curves.crossingU[i], curves.crossingV[i]];
    path.moveTo(u + 1.6, v);
    path.arc(u, v, 1.6, 0, 7);
  }
  return path;
}

export function layerLegend(app: App, layer: Layer): {title: string; named: Named[]} | null {
  const {rig, curves} = app;
  const undecided = {name: 'undecided', color: kUndecided};
  switch (layer) {
    case 'projector': return {title: 'Projector', named: [...(rig?.projectors ?? [])
      .map(({name}, i) => ({name, color: category(i)})), ...(curves ? [undecided] : [])]};
    case 'local': return {title: 'Local ID', named: [...Array.from({length: 8}, (_, i) =>
      ({name: String(i), color: category(i)})), undecided]};
    case 'color': return {title: 'Likeliest code colour', named: (rig?.families ?? []).flat()
      .map((name) => ({name, color: lightColor(name)}))};
    case 'undecided': {
      const present = new Set(curves?.state ?? []);
      return {title: 'Curves', named: kStates.filter((_, i) => present.has(i))};
    }
    case 'confidence': return {title: 'Confidence', named: [
      ...[0, 0.5, 0.9, 1].map((x) => ({name: String(x), color: sequential(x)})),
      ...(curves ? [undecided] : [])]};
    default: return null;
  }
}

/** Near is bright, and so is one depth everywhere; range (where anything is known) and source are in the canvas' dataset. */
export function depthPicture(map: DepthMap): HTMLCanvasElement {
  let [low, high] = [Infinity, -Infinity];
  for (const z of map.depth) {
    if (!Number.isFinite(z)) continue;
    if (z < low) low = z;
    if (z > high) high = z;
  }
  const canvas = h('canvas', {width: map.columns, height: map.rows});
  const context = canvas.getContext('2d')!;
  const pixels = context.createImageData(map.columns, map.rows);
  map.depth.forEach((z, i) => {
    const [r, g, b] = Number.isFinite(z) ? sequential(high > low ? (high - z) / (high - low) : 1) : [24, 24, 28];
    pixels.data.set([r, g, b, 255], 4 * i);
  });
  context.putImageData(pixels, 0, 0);
  Object.assign(canvas.dataset, {source: map.source}, low <= high && {low: String(low), high: String(high)});
  return canvas;
}

/** What the colours of a depthPicture() say. */
export function depthLegend({dataset}: HTMLCanvasElement, unit: string): HTMLElement[] {
  const title = h('strong', {}, `Depth (${dataset.source})`);
  if (dataset.low === undefined) return [title, h('span', {}, 'not known anywhere')];
  const [low, high] = [Number(dataset.low), Number(dataset.high)];
  if (low === high) {
    return [title, h('span', {class: 'key'}, h('i', {style: `background:${css(sequential(1))}`}), `${significant(low)} ${unit}`)];
  }
  const stops = [1, 0.75, 0.5, 0.25, 0].map((x) => css(sequential(x)));
  const end = (z: number) => lengthText(z, 100 * (high - low)); // a hundredth of the range shows
  return [title, h('span', {class: 'ramp', style: `background:linear-gradient(90deg,${stops.join(',')})`}),
    h('span', {class: 'ramp-ends'}, h('span', {}, end(low)), h('span', {}, `${end(high)} ${unit}`))];
}
