// What the page shows, and where it comes from: parts embedded in the page (report) or asked from
// the server (view). The names are those of src/pencilscan/page/result_reader.h.
import {Block, inflateJson, Unpacked} from './block';
import type {DeviceJson} from './device';
import type {FaultJson} from './fault';

export interface PatternJson {
  lines: number;
  vertical: boolean;
  pitch_px: number;
  offset_px: number;
  sequence: number[];
  colors: string[];
}

export interface RigJson {
  cameras: (DeviceJson & {role?: string})[];
  projectors: DeviceJson[];
  patterns: PatternJson[][];
  families: string[][];
  unit: string;
  volume: {center: [number, number, number]; radius: number};
}

export interface ResultJson {
  name: string;
  run: string;
  rig: number;
  truth: boolean;
  scan?: boolean; // from Gray codes: `line` counts columns or rows of the panel
  detail: 'full' | 'shape';
  summary: Record<string, number>;
  parts: string[];
  missing: FaultJson[];
}

/** A frame that has no result. */
export interface FailedJson {
  run: string;
  frame: string;
  why: string;
  action: string; // may be empty
}

export interface CalibrationEntry {
  file: string;
  report?: Record<string, unknown>;
  broken?: string;
}

/** Texts as they stand in a Markdown or CSV file. */
export interface TableJson {
  file: string;
  title: string;
  header: string[];
  rows: string[][];
  total: number; // rows of the file
}

export interface PictureJson {
  file: string;
  group: string; // its folder; empty: the experiment's
  kind: 'still' | 'drawing' | 'moving' | 'video';
  type: string;
  part: number;
  packed?: boolean; // compressed
  width?: number; // px, of the file
  height?: number;
}

export interface RunJson {
  folder: string;
  kind: 'frame' | 'scan' | 'calibration';
  report?: boolean; // has a report.html
  summary?: Record<string, number>;
  verdict?: string;
  broken?: string;
}

export interface ExperimentJson {
  folder: string; // its name
  name?: string;
  title?: string;
  text?: string;
  setting?: string;
  tables: TableJson[];
  pictures: PictureJson[];
  runs: RunJson[];
  commands: string[];
  commands_total?: number;
  missing: FaultJson[];
}

export interface IndexJson {
  mode: 'report' | 'view';
  program: string;
  title: string;
  rigs: (RigJson | null)[];
  results: ResultJson[];
  failed: FailedJson[];
  calibrations: CalibrationEntry[];
  experiment: ExperimentJson | null;
  sequence: boolean; // there is a sequence.json
}

export interface HistogramJson {
  high: number;
  counts: number[];
  above: number;
  count: number;
  median: number;
  p90: number;
}

// Reports may come from other versions: everything in them is looked up with care.
export type Json = null | boolean | number | string | Json[] | {[key: string]: Json | undefined};

export interface Details {
  report?: Json;
  timing?: Json;
  figures?: Json;
  warnings?: {text: string; action: string}[];
  doubts?: FaultJson[]; // what is doubtful, of `missing` too where that was known in time
  histograms?: Record<string, HistogramJson | null>;
}

/** Points as in points.ply; index i is vertex i * stride of the file. */
export interface Points {
  count: number;
  stride: number;
  total: number;
  position: Float32Array; // x y z of each
  u: Float32Array;
  v: Float32Array;
  camera: Uint8Array;
  projector: Uint8Array;
  pattern: Uint8Array;
  line: Uint32Array;
  sigma: Float32Array;
  confidence: Uint8Array;
  distance?: Float32Array;
}

export interface Mesh {
  position: Float32Array;
  index: Uint32Array;
  sigma?: Float32Array;
  confidence?: Uint8Array;
  hole?: Uint8Array;
  distance?: Float32Array;
  color?: Uint8Array; // albedo as sRGB: red green blue of each vertex
  difference?: Float32Array; // to the frame that this one is compared with
}

export interface Curves {
  count: number;
  u: Float32Array;
  v: Float32Array;
  camera: Uint8Array;
  curve: Uint32Array;
  family: Uint8Array;
  color: Uint8Array;
  lead: Uint8Array; // tenths of a nat
  sigma_px: Uint8Array; // 1/500 px
  state: Uint8Array;
  projector: Uint8Array;
  pattern: Uint8Array;
  line: Uint32Array;
  confidence: Uint8Array;
  localId: Uint8Array; // 255: none
  crossingU: Float32Array;
  crossingV: Float32Array;
  crossingCamera: Uint8Array;
  beginOfCamera: number[]; // with one more entry at the end
}

export interface DepthMap {
  columns: number;
  rows: number;
  stride: number;
  source: string;
  depth: Float32Array;
}

function fromBase64(text: string): Uint8Array<ArrayBuffer> {
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; ++i) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

/** By its first bytes; empty for others than those that parts hold. */
export function pictureType(bytes: Uint8Array): string {
  const head = String.fromCharCode(...bytes.subarray(0, 12));
  if (head.startsWith('\xff\xd8\xff')) return 'image/jpeg';
  if (head.startsWith('\x89PNG')) return 'image/png';
  return head.startsWith('RIFF') && head.endsWith('WEBP') ? 'image/webp' : '';
}

function interleave<T extends Float32Array | Uint8Array>(x: T, y: T, z: T): T {
  const all = new (x.constructor as new (length: number) => T)(3 * x.length);
  for (let i = 0; i < x.length; ++i) {
    all[3 * i] = x[i];
    all[3 * i + 1] = y[i];
    all[3 * i + 2] = z[i];
  }
  return all;
}

export class Source {
  readonly index: IndexJson;
  private readonly cache = new Map<string, Promise<unknown>>();

  constructor() {
    this.index = JSON.parse(document.getElementById('index')!.textContent!) as IndexJson;
  }

  has(result: number, part: string): boolean {
    return this.index.results[result]?.parts.includes(part) ?? false;
  }

  /** A picture of the experiment. */
  picture(part: number): Promise<Uint8Array<ArrayBuffer>> {
    return this.bytes('experiment', String(part));
  }

  /** The table of all frames. */
  async sequence<T>(): Promise<T> {
    return inflateJson<T>(await this.bytes('sequence', '0'));
  }

  private async bytes(result: number | 'experiment' | 'sequence', part: string): Promise<Uint8Array<ArrayBuffer>> {
    if (this.index.mode === 'report') {
      const element = document.getElementById(`part/${result}/${part}`);
      if (!element) throw new Error(`${part} is not in this report`);
      return fromBase64(element.textContent!);
    }
    const answer = await fetch(`part/${result}/${part}`);
    if (!answer.ok) throw new Error((await answer.text()).trim() || `${part}: ${answer.status}`);
    return new Uint8Array(await answer.arrayBuffer());
  }

  /** Keeps what was read for the result shown now, and forgets it with forget(). */
  private cached<T>(result: number, part: string, read: () => Promise<T>): Promise<T> {
    const key = `${result}/${part}`;
    let value = this.cache.get(key) as Promise<T> | undefined;
    if (!value) {
      value = read();
      this.cache.set(key, value);
      value.catch(() => {
        if (this.cache.get(key) === value) this.cache.delete(key); // the next who asks may have more luck
      });
    }
    return value;
  }

  forget(exceptResult: number): void {
    for (const key of this.cache.keys()) {
      if (!key.startsWith(`${exceptResult}/`)) this.cache.delete(key);
    }
  }

  private async block(result: number, part: string): Promise<Block> {
    return Block.read(await this.bytes(result, part));
  }

  details(result: number): Promise<Details> {
    return this.cached(result, 'details', async () =>
      inflateJson<Details>(await this.bytes(result, 'details')),
    );
  }

  /** thousands: of faces that will do while a sequence plays, where the source makes a difference. */
  async mesh(result: number, part: 'mesh' | 'measured', thousands = 0): Promise<Mesh> {
    if (thousands > 0 && this.index.mode === 'view') return this.playingMesh(result, thousands);
    const block = await this.block(result, part);
    const optional = (key: string) => (block.has(key) ? block.floats(key) : undefined);
    return {
      position: interleave(block.floats('x'), block.floats('y'), block.floats('z')),
      index: block.integers('index'),
      sigma: optional('sigma'),
      confidence: block.has('confidence') ? block.bytes('confidence') : undefined,
      hole: block.has('hole') ? block.bytes('hole') : undefined,
      distance: optional('distance'),
      color: block.has('red')
        ? interleave(block.bytes('red'), block.bytes('green'), block.bytes('blue')) : undefined,
    };
  }

  private async playingMesh(result: number, thousands: number): Promise<Mesh> {
    const unpacked = new Unpacked(await this.bytes(result, `play/${thousands}`));
    return {
      position: unpacked.array('position', Float32Array)!,
      index: unpacked.array('index', Uint32Array)!,
      sigma: unpacked.array('sigma', Float32Array),
      confidence: unpacked.array('confidence', Uint8Array),
      hole: unpacked.array('hole', Uint8Array),
    };
  }

  points(result: number): Promise<Points> {
    return this.cached(result, 'points', async () => {
      const block = await this.block(result, 'points');
      const camera = block.bytes('camera');
      return {
        count: camera.length,
        stride: block.value<number>('stride'),
        total: block.value<number>('total'),
        position: interleave(block.floats('x'), block.floats('y'), block.floats('z')),
        u: block.floats('u'),
        v: block.floats('v'),
        camera,
        projector: block.bytes('projector'),
        pattern: block.bytes('pattern'),
        line: block.integers('line'),
        sigma: block.floats('sigma'),
        confidence: block.bytes('confidence'),
        distance: block.has('distance') ? block.floats('distance') : undefined,
      };
    });
  }

  curves(result: number): Promise<Curves> {
    return this.cached(result, 'curves', async () => {
      const block = await this.block(result, 'curves');
      const camera = block.bytes('camera');
      const beginOfCamera: number[] = [];
      for (let i = 0; i <= camera.length; ++i) {
        const now = i < camera.length ? camera[i] : 256;
        while (beginOfCamera.length <= now) beginOfCamera.push(i);
      }
      return {
        count: camera.length,
        u: block.floats('u'),
        v: block.floats('v'),
        camera,
        curve: block.integers('curve'),
        family: block.bytes('family'),
        color: block.bytes('color'),
        lead: block.bytes('lead'),
        sigma_px: block.bytes('sigma_px'),
        state: block.bytes('state'),
        projector: block.bytes('projector'),
        pattern: block.bytes('pattern'),
        line: block.integers('line'),
        confidence: block.bytes('confidence'),
        localId: block.bytes('local_id'),
        crossingU: block.floats('crossing_u'),
        crossingV: block.floats('crossing_v'),
        crossingCamera: block.bytes('crossing_camera'),
        beginOfCamera,
      };
    });
  }

  /** image/<camera>, holes/<camera> or thumb. */
  image(result: number, part: string): Promise<ImageBitmap> {
    return this.cached(result, part, async () =>
      createImageBitmap(new Blob([await this.bytes(result, part)])),
    );
  }

  async imageUrl(result: number, part: string): Promise<string> {
    const bytes = await this.bytes(result, part);
    return URL.createObjectURL(new Blob([bytes], {type: pictureType(bytes)}));
  }

  depth(result: number, camera: number): Promise<DepthMap> {
    return this.cached(result, `depth/${camera}`, async () => {
      const block = await this.block(result, `depth/${camera}`);
      return {
        columns: block.value<number>('columns'),
        rows: block.value<number>('rows'),
        stride: block.value<number>('stride'),
        source: block.value<string>('source'),
        depth: block.floats('depth'),
      };
    });
  }

  async files(result: number): Promise<{path: string; bytes: number}[]> {
    const answer = await fetch(`list/${result}`);
    return answer.ok ? answer.json() : [];
  }
}

/** What a frame is called among those of all runs. */
export const rowName = (run: string, frame: string): string => (run ? `${run} / ${frame}` : frame);

/** report["a"]["b"], or undefined where something on the way is missing. */
export function dig(value: Json | undefined, ...path: string[]): Json | undefined {
  for (const key of path) {
    if (value === null || typeof value !== 'object' || Array.isArray(value)) return undefined;
    value = value[key];
  }
  return value;
}

export function digNumber(value: Json | undefined, ...path: string[]): number | undefined {
  const found = dig(value, ...path);
  return typeof found === 'number' && Number.isFinite(found) ? found : undefined;
}

export function digList(value: Json | undefined, ...path: string[]): Json[] {
  const found = dig(value, ...path);
  return Array.isArray(found) ? found : [];
}
