// What calibrate found out: the verdict, residuals over each image, who shares what with whom, and
// how well every parameter is known. Reads calibration.json as docs/report.md describes it, and
// shows of other files what it recognises.
import type {App} from './app';
import {table, tiles, type Tile} from './charts';
import {dig, digList, digNumber, type CalibrationEntry, type Json} from './data';
import {devicesInSpace} from './calibration3d';
import {lesserParts} from './calibration_tables';
import {byId, format, h, percent, svg} from './dom';
import {css, sequential} from './palette';

const textOf = (value: Json | undefined): string =>
  typeof value === 'string' ? value : typeof value === 'boolean' ? String(value) : '';

interface Calibrated {
  name: string;
  json: Json;
}

/** Devices as a list with names, or as an object by name. */
function devicesOf(report: Json): Calibrated[] {
  const found: Calibrated[] = [];
  for (const key of ['devices', 'cameras', 'projectors']) {
    const group = dig(report, key);
    if (Array.isArray(group)) {
      group.forEach((json, i) => found.push({name: textOf(dig(json, 'name')) || `${key} ${i}`, json}));
    } else if (group && typeof group === 'object') {
      for (const [name, json] of Object.entries(group)) found.push({name, json: json ?? null});
    }
  }
  return found;
}

const kMeaning: Record<string, string> = {
  good: 'Nothing speaks against using this rig.',
  doubtful: 'A rig was written. Look at the reasons before relying on it.',
  unusable: 'No rig was written. What is shown below is the attempt that was judged.',
};

type Severity = 'good' | 'unsure' | 'bad';
const severityOf = (word: string): Severity =>
  /unusable|bad|fail|poor|refus/i.test(word) ? 'bad' : /^(good|usable|ok|fine|pass)/i.test(word) ? 'good' : 'unsure';
const kOrder: Severity[] = ['bad', 'unsure', 'good'];
const kMark = {bad: '✕', unsure: '!', good: '✓'};
const kWord = {bad: 'unusable', unsure: 'doubtful', good: 'note'};

/** A sentence's first letter, unless it begins with the name of a parameter; options stay whole. */
function sentence(text: string, begins = true): (string | HTMLElement)[] {
  const begun = !begins || /^[fc][xy]\b|^[kp]\d\b/.test(text) ? text : text.charAt(0).toUpperCase() + text.slice(1);
  return begun.split(/(--[a-z][a-z-]*)/).map((part, i) => (i % 2 ? h('code', {}, part) : part));
}

/** What was found, the gravest first, each with what to do about it. */
function findings(reasons: Json[], verdict: Severity): HTMLElement | null {
  if (!reasons.length) return null;
  const list = reasons.map((r) => {
    const grade = textOf(dig(r, 'grade'));
    return {text: textOf(r) || textOf(dig(r, 'what')) || JSON.stringify(r), advice: textOf(dig(r, 'advice')),
      severity: grade ? severityOf(grade) : verdict};
  }).sort((x, y) => kOrder.indexOf(x.severity) - kOrder.indexOf(y.severity));
  return h('ul', {class: 'findings'}, ...list.map(({text, advice, severity}) =>
    h('li', {class: severity}, h('span', {class: 'grade'}, kWord[severity]),
      h('div', {}, h('p', {class: 'what'}, ...sentence(text)),
        advice ? h('p', {class: 'advice'}, h('strong', {}, 'What to do: '), ...sentence(advice, false)) : null))));
}

function verdict(report: Json): HTMLElement {
  const stated = dig(report, 'verdict');
  const word = textOf(stated) || textOf(dig(stated, 'word')) || textOf(dig(stated, 'status')) || 'no verdict stated';
  const severity = severityOf(word);
  const reasons = [...digList(report, 'reasons'), ...digList(stated, 'reasons'), ...digList(report, 'warnings')];
  return h('div', {class: `verdict large ${severity}`, role: 'status'},
    h('p', {class: 'verdict-word'}, h('span', {class: 'mark', 'aria-hidden': 'true'}, kMark[severity]),
      h('span', {}, h('strong', {}, `Verdict: ${word}`), kMeaning[word] ? h('span', {class: 'meaning'}, kMeaning[word]) : null)),
    findings(reasons, severity));
}

function keyFigures(report: Json, unit: string): HTMLElement {
  const list: Tile[] = [];
  const add = (name: string, value: number | undefined, text: (x: number) => string, hint?: string) => {
    if (value !== undefined) list.push({name, value: text(value), hint});
  };
  const px = (x: number) => `${format(x)} px`;
  add('RMS of reprojection', digNumber(report, 'rms_px'), px, 'over all devices');
  add('RMS, held out', digNumber(report, 'held_out_rms_px'), px, 'of points that the adjustment did not see');
  const p95 = digNumber(report, 'volume', 'point_sigma_p95');
  add('Point in the volume', digNumber(report, 'volume', 'point_sigma_median'), (x) => `${format(x, 2)} ${unit}`,
    `one standard deviation, scale apart, median${p95 === undefined ? '' : `; 95 % below ${format(p95, 2)}`}`);
  const best = digList(report, 'scale', 'best_distance', 'devices').map(textOf);
  const bestSigma = digNumber(report, 'scale', 'best_distance', 'length_sigma_percent');
  add('Lengths in the volume', digNumber(report, 'scale', 'length_sigma_percent'), (x) => `${format(x, 2)} %`,
    `one standard deviation of the scale${bestSigma === undefined ? '' : `; ${format(bestSigma, 2)} % by the distance of ${best.join(' and ')}`}`);
  add('Surface points', digNumber(report, 'tracks'), (x) => format(x), 'seen by several devices');
  const dropped = digNumber(report, 'views_dropped');
  add('Views', digNumber(report, 'views'), (x) => format(x),
    dropped === undefined ? undefined : `${format(dropped)} more were dropped as outliers`);
  if (textOf(dig(report, 'unit')) === 'unknown') {
    list.push({name: 'Scale', value: 'unknown', hint: 'distances are relative; see the notes'});
  }
  return tiles(list);
}

type Residual = [u: number, v: number, du: number, dv: number];

const residualsOf = ({json}: Calibrated): Residual[] => digList(json, 'residuals')
  .filter((r): r is number[] => Array.isArray(r) && r.length >= 4 && r.every((x) => typeof x === 'number'))
  .map((r) => r as unknown as Residual);

const lengthOf = ([, , du, dv]: Residual): number => Math.hypot(du, dv);

/** Below this length lie 90 % of the residuals of the worst device: one scale for all. */
function commonScale(devices: Calibrated[]): number {
  const high = devices.map((device) => {
    const lengths = residualsOf(device).map(lengthOf).sort((a, b) => a - b);
    return lengths[Math.floor(0.9 * (lengths.length - 1))] ?? 0;
  });
  return Math.max(1e-6, ...high);
}

/** Residuals over the image, magnified; none longer than three times the scale's end. */
function residualChart(device: Calibrated, high: number): HTMLElement | null {
  const residuals = residualsOf(device);
  if (!residuals.length) return null;
  const width = digNumber(device.json, 'width') ?? Math.max(1, ...residuals.map((r) => r[0]));
  const height = digNumber(device.json, 'height') ?? Math.max(1, ...residuals.map((r) => r[1]));
  const lengths = residuals.map(lengthOf).sort((a, b) => a - b);
  const median = digNumber(device.json, 'median_px') ?? lengths[Math.floor(lengths.length / 2)];
  const rms = digNumber(device.json, 'rms_px');
  const magnified = width / 25 / high;
  const stride = Math.ceil(residuals.length / 1500);
  const words = `median ${format(median, 2)} px${rms === undefined ? '' : `, RMS ${format(rms, 2)} px`}`;
  const picture = svg('svg', {viewBox: `0 0 ${width} ${height}`, role: 'img', class: 'residuals',
    'aria-label': `${device.name}: residuals over the image, ${words}`});
  picture.append(svg('rect', {x: 0, y: 0, width, height, class: 'image-area'}));
  for (let i = 0; i < residuals.length; i += stride) {
    const [u, v, du, dv] = residuals[i];
    const length = lengthOf(residuals[i]);
    const s = magnified * Math.min(1, (3 * high) / Math.max(length, 1e-12));
    const color = css(sequential(length / high));
    picture.append(
      svg('line', {x1: u, y1: v, x2: u + du * s, y2: v + dv * s, stroke: color, 'stroke-width': width / 300}),
      svg('circle', {cx: u, cy: v, r: width / 400, fill: color}));
  }
  return h('figure', {class: 'chart'}, h('figcaption', {}, h('strong', {}, device.name), ` ${words}`), picture);
}

function residualLegend(high: number): HTMLElement {
  const stops = [0, 0.25, 0.5, 0.75, 1].map((x) => css(sequential(x)));
  return h('p', {class: 'inline-legend'},
    'Residuals: how far, and in which direction, observation and model differ; magnified, on one scale for all devices. ',
    h('span', {class: 'ramp', style: `background:linear-gradient(90deg,${stops.join(',')})`}),
    ` 0 – ${format(high, 2)} px`);
}

interface Edge {
  a: string;
  b: string;
  shared: number;
}

function edgesOf(report: Json): Edge[] {
  return [...digList(report, 'overlap'), ...digList(report, 'pairs')].flatMap((edge) => {
    const a = textOf(dig(edge, 'a')) || textOf(dig(edge, 'camera'));
    const b = textOf(dig(edge, 'b')) || textOf(dig(edge, 'projector'));
    const shared = digNumber(edge, 'correspondences') ?? digNumber(edge, 'shared') ?? 0;
    return a && b ? [{a, b, shared}] : [];
  });
}

/** Devices on a circle; the more two share, the thicker their line. */
function overlapGraph(edges: Edge[]): HTMLElement | null {
  if (!edges.length) return null;
  const names = [...new Set(edges.flatMap(({a, b}) => [a, b]))].sort();
  // Two lie beside each other, more on a circle.
  const [start, height] = names.length === 2 ? [-Math.PI, 110] : [-Math.PI / 2, 330];
  const at = (name: string) => {
    const angle = (2 * Math.PI * names.indexOf(name)) / names.length + start;
    return [210 + 135 * Math.cos(angle), height / 2 + 135 * Math.sin(angle)];
  };
  const most = Math.max(1, ...edges.map((e) => e.shared));
  const picture = svg('svg', {viewBox: `0 0 420 ${height}`, role: 'img', class: 'overlap', 'aria-label':
    `Shared points: ${edges.map((e) => `${e.a} and ${e.b} ${e.shared}`).join(', ')}`});
  for (const {a, b, shared} of edges) {
    const [[x1, y1], [x2, y2]] = [at(a), at(b)];
    picture.append(svg('line', {x1, y1, x2, y2, class: shared > 0 ? 'edge' : 'edge none',
      'stroke-width': 0.6 + (7 * shared) / most}, svg('title', {}, `${a} – ${b}: ${format(shared)}`)));
    if (edges.length <= 3) {
      picture.append(svg('text', {x: (x1 + x2) / 2, y: (y1 + y2) / 2 - 10, 'text-anchor': 'middle'}, format(shared)));
    }
  }
  for (const name of names) {
    const [x, y] = at(name);
    picture.append(svg('circle', {cx: x, cy: y, r: 7, class: 'node'}),
      svg('text', {x, y: y + (y < height / 2 ? -13 : 22), 'text-anchor': 'middle'}, name));
  }
  return h('figure', {class: 'chart'}, h('figcaption', {}, h('strong', {}, 'Overlap'),
    ' the more points two devices share, the thicker their line'), picture);
}

/** The same as numbers: cameras in rows, projectors in columns. */
function overlapTable(edges: Edge[], report: Json): HTMLElement | null {
  if (!edges.length) return null;
  const rows = [...new Set(edges.map((e) => e.a))].sort();
  const columns = [...new Set(edges.map((e) => e.b))].sort();
  const decoded = digList(report, 'decoding');
  return table(['', ...columns], rows.map((a) => [a, ...columns.map((b) => {
    const edge = edges.find((e) => e.a === a && e.b === b);
    const valid = decoded.filter((d) => dig(d, 'camera') === a && dig(d, 'projector') === b)
      .map((d) => digNumber(d, 'valid_share_of_lit')).find((x) => x !== undefined);
    if (!edge) return '–';
    return `${format(edge.shared)}${valid === undefined ? '' : ` (${percent(valid, 0)})`}`;
  })]), `Points that a camera shares with a projector${decoded.length ? ' (share of lit pixels with a code)' : ''}`);
}

/** "12.34 ± 0.05": as many digits as the deviation deserves. */
export function withSigma(value: number, sigma: number | undefined): string {
  if (sigma === undefined) return format(value, 5);
  if (!(sigma > 0)) return `${format(value, 5)} (given)`;
  const digits = Math.min(8, Math.max(0, 1 - Math.floor(Math.log10(sigma))));
  return `${value.toFixed(digits)} ± ${sigma.toFixed(digits)}`;
}

const kParameters = ['fx', 'fy', 'cx', 'cy', 'k1', 'k2', 'p1', 'p2', 'k3'];

/** value ± sigma of each parameter, whatever they are called. */
function parameterTable(devices: Calibrated[], unit: string): HTMLElement | null {
  const seen = new Set<string>();
  const rows = devices.map(({name, json}) => {
    const values = new Map<string, string>();
    const put = (key: string, text: string | undefined) => {
      if (text !== undefined) values.set(key, text);
    };
    const parameters = dig(json, 'parameters');
    if (parameters && typeof parameters === 'object' && !Array.isArray(parameters)) {
      for (const [key, entry] of Object.entries(parameters)) {
        const value = typeof entry === 'number' ? entry : digNumber(entry, 'value');
        if (value !== undefined) put(key, withSigma(value, digNumber(entry, 'sigma')));
      }
    }
    for (const key of values.keys()) seen.add(key);
    const number = (key: string, ...path: string[]) => {
      const value = digNumber(json, ...path);
      if (value !== undefined) put(key, format(value));
    };
    number('RMS px', 'rms_px');
    number('95 % px', 'p95_px');
    number('Views', 'views');
    const turn = digNumber(json, 'rotation_sigma_deg');
    if (turn !== undefined) put('Rotation ± °', format(turn, 2));
    const place = digList(json, 'position_sigma').filter((x): x is number => typeof x === 'number');
    if (place.length === 3) put(`Position ± ${unit}`, format(Math.hypot(...place), 2));
    if (dig(json, 'placed') === false) put('Views', 'not placed');
    return {name, values};
  });
  if (!rows.length) return null;
  const names = ['Views', 'RMS px', '95 % px', `Position ± ${unit}`, 'Rotation ± °',
    ...kParameters.filter((key) => seen.has(key)), ...[...seen].filter((key) => !kParameters.includes(key))]
    .filter((key) => rows.some(({values}) => values.has(key)));
  return table(['Device', ...names],
    rows.map(({name, values}) => [name, ...names.map((key) => values.get(key) ?? '–')]),
    'Parameters with one standard deviation (px; given: taken over, not adjusted)');
}

function showOne(app: App, root: HTMLElement, entry: CalibrationEntry): void {
  if (!entry.report) {
    root.append(h('p', {class: 'verdict bad'}, `${entry.file} cannot be read: ${entry.broken ?? 'unknown reason'}`));
    return;
  }
  const report = entry.report as Json;
  const unit = textOf(dig(report, 'unit')) === 'mm' ? 'mm' : 'units';
  const devices = devicesOf(report);
  const edges = edgesOf(report);
  const high = commonScale(devices);
  const residuals = devices.map((device) => residualChart(device, high)).filter((x) => x !== null);
  const projectors = new Set(edges.map(({b}) => b));
  const space = devicesInSpace(devices, report, (name) => projectors.has(name), (paint) => app.on('theme', paint));
  const shared = [space, overlapGraph(edges), overlapTable(edges, report)].filter((x) => x !== null);
  root.append(verdict(report), keyFigures(report, unit));
  if (shared.length) root.append(h('div', {class: 'grid wide'}, ...shared));
  if (residuals.length) root.append(residualLegend(high), h('div', {class: 'grid'}, ...residuals));
  if (!shared.length && !residuals.length) root.append(h('p', {}, 'The file holds no residuals and no overlap.'));
  const parameters = parameterTable(devices, unit);
  if (parameters) root.append(parameters);
  root.append(...lesserParts(report, unit));
  root.append(h('details', {class: 'raw'}, h('summary', {}, `All numbers of ${entry.file} (JSON)`),
    h('pre', {tabindex: 0}, JSON.stringify(report, null, 1).slice(0, 200000))));
}

export function showCalibrations(app: App): void {
  const {calibrations} = app.source.index;
  byId('calibration-section').hidden = byId('calibration-link').hidden = calibrations.length === 0;
  const root = byId('calibration');
  for (const entry of calibrations) {
    if (calibrations.length > 1) root.append(h('h3', {}, entry.file));
    showOne(app, root, entry);
  }
}
