// What is shown now, and what is selected in it. Panels listen and never talk to each other.
import type {Curves, DepthMap, PatternJson, Points, RigJson, Source} from './data';
import {Device} from './device';

export interface Selection {
  camera: number;
  u: number; // px in that camera
  v: number;
  point: number; // index in points; -1: an undecided curve point
  sample: number; // index in curves; -1: not known
}

/** Of the places [begin, end) that count, the one nearest to (u, v); -1: none within `reach`. */
function nearest(places: {u: ArrayLike<number>; v: ArrayLike<number>}, begin: number, end: number,
    u: number, v: number, reach: number, counts: (i: number) => boolean = () => true): number {
  let best = -1;
  let least = reach * reach;
  for (let i = begin; i < end; ++i) {
    const d = (places.u[i] - u) ** 2 + (places.v[i] - v) ** 2;
    if (d < least && counts(i)) {
      least = d;
      best = i;
    }
  }
  return best;
}

/** A frame that the shown one is compared with. */
export interface Reference {
  result: number;
  how: 'beside' | 'difference';
}

type Happening = 'result' | 'points' | 'curves' | 'selection' | 'theme' | 'reference';

export class App {
  result = 0;
  reference: Reference | null = null;
  rig: RigJson | null = null;
  cameras: Device[] = [];
  points: Points | null = null;
  curves: Curves | null = null;
  depth: (DepthMap | null)[] = [];
  selection: Selection | null = null;
  private readonly listeners = new Map<string, (() => void)[]>();

  constructor(readonly source: Source) {}

  on(what: Happening, listener: () => void): void {
    this.listeners.set(what, [...(this.listeners.get(what) ?? []), listener]);
  }

  tell(what: Happening): void {
    for (const listener of this.listeners.get(what) ?? []) listener();
  }

  compareWith(reference: Reference | null): void {
    this.reference = reference;
    this.tell('reference');
  }

  /** Shows another result; its parts arrive one after another. */
  show(result: number): void {
    const {source} = this;
    const found = source.index.results[result];
    this.result = result;
    source.forget(result);
    this.rig = found && found.rig >= 0 ? source.index.rigs[found.rig] : null;
    this.cameras = (this.rig?.cameras ?? []).map((camera) => new Device(camera));
    this.points = null;
    this.curves = null;
    this.depth = [];
    this.selection = null;
    this.tell('result');
    this.tell('selection');
  }

  /** Asks for points and curves of the shown result, once the first picture is there. */
  async loadMeasurements(): Promise<void> {
    const {result, source} = this;
    const load = async <T>(part: string, read: () => Promise<T>): Promise<T | null> => {
      if (!source.has(result, part)) return null;
      return read().catch((error: unknown) => {
        console.warn(`${part}: ${String(error)}`);
        return null;
      });
    };
    const points = await load('points', () => source.points(result));
    if (this.result !== result) return;
    this.points = points;
    this.tell('points');
    const curves = await load('curves', () => source.curves(result));
    if (this.result !== result) return;
    this.curves = curves;
    this.tell('curves');
    for (let c = 0; c < this.cameras.length; ++c) {
      const map = await load(`depth/${c}`, () => source.depth(result, c));
      if (this.result !== result) return;
      this.depth[c] = map;
    }
    this.tell('selection');
  }

  /** The pattern that a point's line belongs to; none where lines are not those of the rig. */
  patternOf(point: number): PatternJson | undefined {
    const {points, rig, source} = this;
    if (!points || source.index.results[this.result]?.scan) return undefined;
    return rig?.patterns[points.projector[point]]?.[points.pattern[point]];
  }

  position(point: number): [number, number, number] {
    const p = this.points!.position;
    return [p[3 * point], p[3 * point + 1], p[3 * point + 2]];
  }

  selectPoint(point: number): void {
    const {points} = this;
    if (!points) return;
    const camera = points.camera[point];
    const [u, v] = [points.u[point], points.v[point]];
    this.selection = {camera, u, v, point, sample: this.nearestSample(camera, u, v, 1.5)};
    this.tell('selection');
  }

  selectSample(sample: number): void {
    const curves = this.curves!;
    this.selection = {camera: curves.camera[sample], u: curves.u[sample], v: curves.v[sample],
      point: -1, sample};
    this.tell('selection');
  }

  clearSelection(): void {
    this.selection = null;
    this.tell('selection');
  }

  /** The curve point of a camera nearest to a pixel; -1 when none is within `reach` px. */
  nearestSample(camera: number, u: number, v: number, reach: number): number {
    const {curves} = this;
    if (!curves) return -1;
    const end = curves.beginOfCamera[camera + 1] ?? curves.count;
    return nearest(curves, curves.beginOfCamera[camera] ?? 0, end, u, v, reach);
  }

  /** The same among the measured points. */
  nearestPoint(camera: number, u: number, v: number, reach: number): number {
    const {points} = this;
    if (!points) return -1;
    return nearest(points, 0, points.count, u, v, reach, (i) => points.camera[i] === camera);
  }

  /** Selects what a click at a pixel of a camera means: a measured point, or an undecided curve. */
  pick(camera: number, u: number, v: number, reach: number): boolean {
    const point = this.nearestPoint(camera, u, v, reach);
    const sample = this.nearestSample(camera, u, v, reach);
    const away = (x: number, y: number) => Math.hypot(x - u, y - v);
    const toPoint = point < 0 ? Infinity : away(this.points!.u[point], this.points!.v[point]);
    const toSample = sample < 0 ? Infinity : away(this.curves!.u[sample], this.curves!.v[sample]);
    // A labelled curve and its point lie on each other: the point says more.
    if (point >= 0 && (toPoint <= toSample + 1 || this.curves!.state[sample] === 0)) {
      this.selectPoint(point);
    } else if (sample >= 0) {
      this.selectSample(sample);
    } else {
      return false;
    }
    return true;
  }

  /** The next point of the same camera and line, above (step > 0) or below in the image. */
  step(step: number): void {
    const {points, selection} = this;
    if (!points || !selection || selection.point < 0) return;
    const now = selection.point;
    const order: number[] = [];
    for (let i = 0; i < points.count; ++i) {
      if (points.camera[i] === points.camera[now] && points.line[i] === points.line[now] &&
          points.projector[i] === points.projector[now] &&
          points.pattern[i] === points.pattern[now]) order.push(i);
    }
    let [lowU, highU, lowV, highV] = [Infinity, -Infinity, Infinity, -Infinity];
    for (const i of order) {
      lowU = Math.min(lowU, points.u[i]);
      highU = Math.max(highU, points.u[i]);
      lowV = Math.min(lowV, points.v[i]);
      highV = Math.max(highV, points.v[i]);
    }
    const along = highU - lowU > highV - lowV ? points.u : points.v;
    order.sort((a, b) => along[a] - along[b]);
    const next = order[order.indexOf(now) + step];
    if (next !== undefined) this.selectPoint(next);
  }

  /** Whether a camera sees a world point; null where it is not known. */
  sees(camera: number, x: number, y: number, z: number):
    {u: number; v: number; visible: boolean | null} | null {
    const at = this.cameras[camera]?.project(x, y, z);
    if (!at || !this.cameras[camera].contains(at.u, at.v)) return null;
    const map = this.depth[camera];
    if (!map) return {u: at.u, v: at.v, visible: null};
    const column = Math.round(at.u / map.stride);
    const row = Math.round(at.v / map.stride);
    let nearest = Infinity;
    let known = false;
    for (let dr = -1; dr <= 1; ++dr) {
      for (let dc = -1; dc <= 1; ++dc) {
        const [r, c] = [row + dr, column + dc];
        if (r < 0 || c < 0 || r >= map.rows || c >= map.columns) continue;
        const depth = map.depth[r * map.columns + c];
        if (!Number.isFinite(depth)) continue;
        known = true;
        nearest = Math.min(nearest, Math.abs(depth - at.depth));
      }
    }
    const tolerance = 0.02 * (this.rig?.volume.radius ?? 100);
    return {u: at.u, v: at.v, visible: known ? nearest < tolerance : null};
  }
}
