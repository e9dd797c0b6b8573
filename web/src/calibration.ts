// What calibrate found out: the verdict, residuals over each image, who shares what with whom, and
// how well every parameter is known. Reads calibration.json as docs/report.md describes it, and
// shows of other files what it recognises.
import type {App} from './app';
import {table} from './charts';
import {dig, digList, digNumber, type Json} from './data';
import {byId, format, h, svg} from './dom';
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

function verdict(report: Json): HTMLElement {
  const stated = dig(report, 'verdict');
  const word = textOf(stated) || textOf(dig(stated, 'word')) || textOf(dig(stated, 'status')) || 'no verdict stated';
  const bad = /unusable|bad|fail|poor|refus/i.test(word);
  const good = /^(good|usable|ok|fine|pass)/i.test(word);
  const reasons = [...digList(report, 'reasons'), ...digList(stated, 'reasons'), ...digList(report, 'warnings')]
    .map((r) => textOf(r) || [textOf(dig(r, 'what')), textOf(dig(r, 'advice'))].filter(Boolean).join(': ') ||
      JSON.stringify(r));
  const rms = digNumber(report, 'rms_px');
  return h('div', {class: `verdict ${bad ? 'bad' : good ? '' : 'unsure'}`, role: 'status'},
    h('strong', {}, word), rms === undefined ? '' : ` · RMS of reprojection ${format(rms)} px`,
    reasons.length ? h('ul', {}, ...reasons.map((text) => h('li', {}, text))) : null);
}

/** [[u, v, du, dv], ...] over the image; arrows are magnified. */
function residualChart(device: Calibrated): HTMLElement | null {
  const residuals = digList(device.json, 'residuals')
    .filter((r): r is number[] => Array.isArray(r) && r.length >= 4 && r.every((x) => typeof x === 'number'));
  const width = digNumber(device.json, 'width') ?? Math.max(1, ...residuals.map((r) => r[0]));
  const height = digNumber(device.json, 'height') ?? Math.max(1, ...residuals.map((r) => r[1]));
  if (!residuals.length) return null;
  const lengths = residuals.map((r) => Math.hypot(r[2], r[3])).sort((a, b) => a - b);
  const high = lengths[Math.floor(0.9 * (lengths.length - 1))] || 1e-9;
  const scale = width / 25 / high;
  const stride = Math.ceil(residuals.length / 1500);
  const median = lengths[Math.floor(lengths.length / 2)];
  const picture = svg('svg', {viewBox: `0 0 ${width} ${height}`, role: 'img', class: 'residuals',
    'aria-label': `${device.name}: residuals, median ${format(median)} px, 90 % below ${format(high)} px`});
  picture.append(svg('rect', {x: 0, y: 0, width, height, class: 'image-area'}));
  for (let i = 0; i < residuals.length; i += stride) {
    const [u, v, du, dv] = residuals[i];
    picture.append(svg('line', {x1: u, y1: v, x2: u + du * scale, y2: v + dv * scale,
      stroke: css(sequential(Math.hypot(du, dv) / high)), 'stroke-width': width / 400}));
  }
  return h('figure', {class: 'chart'}, h('figcaption', {}, h('strong', {}, device.name),
    ` median ${format(median)} px; arrows ${format(scale, 2)} times as long`), picture);
}

/** Devices on a circle; the more two share, the thicker their line. */
function overlapGraph(report: Json): HTMLElement | null {
  const edges = [...digList(report, 'overlap'), ...digList(report, 'pairs')].flatMap((edge) => {
    const a = textOf(dig(edge, 'a')) || textOf(dig(edge, 'camera'));
    const b = textOf(dig(edge, 'b')) || textOf(dig(edge, 'projector'));
    const shared = digNumber(edge, 'correspondences') ?? digNumber(edge, 'shared') ?? 0;
    return a && b ? [{a, b, shared}] : [];
  });
  if (!edges.length) return null;
  const names = [...new Set(edges.flatMap(({a, b}) => [a, b]))].sort();
  const at = (name: string) => {
    const angle = (2 * Math.PI * names.indexOf(name)) / names.length - Math.PI / 2;
    return [210 + 140 * Math.cos(angle), 180 + 140 * Math.sin(angle)];
  };
  const most = Math.max(1, ...edges.map((e) => e.shared));
  const picture = svg('svg', {viewBox: '0 0 420 360', role: 'img', class: 'overlap', 'aria-label':
    `Shared points: ${edges.map((e) => `${e.a} and ${e.b} ${e.shared}`).join(', ')}`});
  for (const {a, b, shared} of edges) {
    const [[x1, y1], [x2, y2]] = [at(a), at(b)];
    picture.append(svg('line', {x1, y1, x2, y2, class: shared > 0 ? 'edge' : 'edge none',
      'stroke-width': 0.6 + (7 * shared) / most}, svg('title', {}, `${a} – ${b}: ${format(shared)}`)));
  }
  for (const name of names) {
    const [x, y] = at(name);
    picture.append(svg('circle', {cx: x, cy: y, r: 7, class: 'node'}),
      svg('text', {x, y: y + (y < 180 ? -13 : 22), 'text-anchor': 'middle'}, name));
  }
  return h('figure', {class: 'chart'}, h('figcaption', {}, h('strong', {}, 'Overlap'),
    ' who shares how many points with whom'), picture);
}

/** value ± sigma of each parameter, whatever they are called. */
function parameterTable(devices: Calibrated[]): HTMLElement | null {
  const names = new Set<string>();
  const rows = devices.map(({name, json}) => {
    const values = new Map<string, string>();
    const parameters = dig(json, 'parameters');
    if (parameters && typeof parameters === 'object' && !Array.isArray(parameters)) {
      for (const [key, entry] of Object.entries(parameters)) {
        const value = typeof entry === 'number' ? entry : digNumber(entry, 'value');
        const sigma = digNumber(entry, 'sigma');
        if (value === undefined) continue;
        names.add(key);
        values.set(key, `${format(value, 5)}${sigma === undefined ? '' : ` ± ${format(sigma, 2)}`}`);
      }
    }
    return {name, values, rms: digNumber(json, 'rms_px'), views: digNumber(json, 'views')};
  });
  if (!rows.length) return null;
  return table(['Device', 'RMS px', 'Views', ...names],
    rows.map(({name, values, rms, views}) =>
      [name, format(rms), format(views), ...[...names].map((key) => values.get(key) ?? '–')]),
    'Parameters with one standard deviation');
}

export function showCalibrations(app: App): void {
  const {calibrations} = app.source.index;
  byId('calibration-section').hidden = byId('calibration-link').hidden = calibrations.length === 0;
  for (const entry of calibrations) {
    const root = byId('calibration');
    if (calibrations.length > 1) root.append(h('h3', {}, entry.file));
    if (!entry.report) {
      root.append(h('p', {class: 'verdict bad'}, `It cannot be read: ${entry.broken ?? 'unknown reason'}`));
      continue;
    }
    const report = entry.report as Json;
    const devices = devicesOf(report);
    const charts = [overlapGraph(report), ...devices.map(residualChart)].filter((x) => x !== null);
    root.append(verdict(report), h('div', {class: 'grid'}, ...charts));
    const parameters = parameterTable(devices);
    if (parameters) root.append(parameters);
    if (!charts.length) root.append(h('p', {}, 'The file holds no residuals and no overlap.'));
    root.append(h('details', {class: 'raw'}, h('summary', {}, `All numbers of ${entry.file} (JSON)`),
      h('pre', {tabindex: 0}, JSON.stringify(report, null, 1).slice(0, 200000))));
  }
}
