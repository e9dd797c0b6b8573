// Warnings, key figures, histograms and tables of the shown result.
import type {App} from './app';
import {bars, histogramChart, table, tiles, type Tile} from './charts';
import {dig, digList, digNumber, type Details, type Json} from './data';
import {byId, format, h} from './dom';
import {faultItem} from './fault';
import {figureText, kFigures, type FigureName, type FigureText} from './figure_text';
import {kHoles} from './palette';
import {kStageWords, wordList} from './words';

const kReasons = ['no_crossing', 'ambiguous', 'contradicted', 'outside_volume'];
const words = (key: string) => key.replace(/_/g, ' ');
const kStages = ['reading', 'detection', 'grid', 'solution', 'refinement', 'guided matching', 'triangulation',
  'depth', 'surface', 'holes', 'color', 'guided matching on the surface', 'confirmation', 'pictures'];
const kBands = ['below_3px', '3_5px', '5_8px', '8_12px', 'from_12px'];

/** In the order of `known`; what is not in it comes last. */
const inOrder = <T>(entries: [string, T][], known: string[]): [string, T][] => {
  const place = (key: string) => (known.includes(key) ? known.indexOf(key) : known.length);
  return entries.sort(([a], [b]) => place(a) - place(b));
};

export class Figures {
  constructor(private readonly app: App) {
    app.on('result', () => void this.load());
  }

  private async load(): Promise<void> {
    const {app} = this;
    const {result, source} = app;
    byId('figures').replaceChildren();
    byId('warnings').replaceChildren();
    if (!source.index.results[result]) return;
    const details = await source.details(result).catch((error: unknown): Details =>
      ({doubts: [{what: 'details', why: String(error), kind: 'unreadable'}]}));
    if (app.result !== result) return;
    this.warnings(details);
    byId('figures').append(this.tiles(details), this.charts(details), ...this.tables(details));
    if (source.index.mode === 'view') void this.files();
  }

  private warnings(details: Details): void {
    const found = this.app.source.index.results[this.app.result];
    const list = byId('warnings');
    const items = details.warnings ?? [];
    for (const {text, action} of items) {
      list.append(h('li', {class: 'warning'}, h('strong', {}, text), action ? h('p', {}, action) : null));
    }
    const faults = [...details.doubts ?? [], ...found.missing.filter(({kind}) => kind !== 'doubtful')];
    list.append(...faults.map((fault) => faultItem(fault, this.nameOf(fault.what))));
    if (!list.childElementCount) {
      list.append(h('li', {class: 'fine'}, h('strong', {}, 'Nothing to warn of in this result.')));
    }
    byId('warning-count').textContent = items.length + faults.length > 0
      ? `${items.length + faults.length} to look at` : 'all fine';
  }

  /** "image/1" in words. */
  private nameOf(part: string): string {
    const [, kind, camera] = part.match(/^(image|holes|depth)\/(\d+)$/) ?? [];
    if (!kind) return part;
    const name = this.app.cameras[Number(camera)]?.name ?? `camera ${camera}`;
    return `${{image: 'picture', holes: 'hole map', depth: 'depth'}[kind]} of ${name}`;
  }

  private tiles(details: Details): HTMLElement {
    const {report, figures, timing, histograms} = details;
    const {summary} = this.app.source.index.results[this.app.result];
    const list: Tile[] = [];
    const unit = this.app.rig?.unit ?? 'mm';
    const add = (key: FigureName, value: number | undefined, more?: string) => {
      const {name, hint}: FigureText = kFigures[key];
      if (value !== undefined) list.push({name, value: figureText(key, value, unit), hint: [hint, more].filter(Boolean).join('; ')});
    };
    add('points', digNumber(report, 'points') ?? summary.points ?? histograms?.confidence?.count);
    if (this.app.source.has(this.app.result, 'mesh')) add('measured_share', digNumber(report, 'surface', 'measured_share'));
    add('sigma_median', histograms?.sigma_mm?.median);
    add('crossing_px', digNumber(report, 'crossing_disagreement', 'median_px'),
      `noise explains ${figureText('crossing_expected_px', digNumber(report, 'crossing_disagreement', 'expected_px'))}`);
    for (const key of ['label_error', 'line_recall', 'distance_median_mm', 'completeness_1mm'] as const) add(key, digNumber(figures, key));
    add('total', digNumber(timing, 'seconds', 'total') ?? summary.seconds, `${format(digNumber(timing, 'threads'))} threads`);
    return tiles(list);
  }

  private charts(details: Details): HTMLElement {
    const grid = h('div', {class: 'grid'});
    const {histograms, timing, figures, report} = details;
    const chart = (key: string, title: string, unit: string, marks: {at: number; text: string}[] = []) => {
      const data = histograms?.[key];
      if (data) grid.append(histogramChart(title, data, unit, marks));
    };
    const unit = this.app.rig?.unit ?? 'mm';
    chart('sigma_mm', 'Sigma of the points', unit);
    chart('error_mm', 'Distance of the points to the truth', unit);
    chart('error_over_sigma', 'Error along the ray, in sigmas', '',
      [{at: 1, text: '1 σ'}, {at: 2, text: '2 σ'}]);
    chart('confidence', 'Confidence of the points', '');
    const seconds = dig(timing, 'seconds');
    if (seconds && typeof seconds === 'object' && !Array.isArray(seconds)) {
      const rows = inOrder(Object.entries(seconds), kStages)
        .filter(([key, value]) => key !== 'total' && typeof value === 'number')
        .map(([key, value]) => [words(key), value as number, figureText('total', value as number)] as [string, number, string]);
      if (rows.length) grid.append(bars('Time per stage', rows, undefined, (name) => kStageWords[name]));
    }
    const recall = (key: string, title: string) => {
      const group = dig(figures, key);
      if (!group || typeof group !== 'object' || Array.isArray(group)) return;
      const rows = inOrder(Object.entries(group), kBands).flatMap(([name, entry]) => {
        const value = digNumber(entry, 'line_recall');
        return value === undefined ? [] : [[spacing(name), value, figureText('line_recall', value)] as [string, number, string]];
      });
      if (rows.length) grid.append(bars(title, rows, 1));
    };
    recall('by_projector', 'Line recall by projector');
    recall('by_spacing', 'Line recall by spacing in the image');
    const area = dig(report, 'surface', 'area_mm2');
    if (area && typeof area === 'object' && !Array.isArray(area)) {
      const entries = Object.entries(area).filter(([, v]) => typeof v === 'number') as [string, number][];
      const total = entries.reduce((sum, [, v]) => sum + v, 0);
      if (total > 0) {
        grid.append(bars('Surface by what is known of it',
          entries.filter(([, v]) => v > 0).sort(([, a], [, b]) => b - a).map(([key, v]) => [words(key), v / total, figureText('measured_share', v / total)]), 1,
          (name) => kHoles.find((hole) => hole.name === name)?.about));
      }
    }
    return grid;
  }

  private tables(details: Details): HTMLElement[] {
    const {report, figures} = details;
    const result: HTMLElement[] = [];
    const cameras = digList(report, 'cameras');
    if (cameras.length) {
      result.push(table(
        ['Camera', 'Curves', 'Curve points', 'Labelled', ...kReasons.map(words), 'Crossings', kFigures.sigma_px.name, kFigures.saturated_pixels.name],
        cameras.map((camera) => {
          const n = (...path: string[]) => digNumber(camera, ...path);
          const points = n('curve_points');
          const labelled = n('labelled_curve_points');
          return [text(dig(camera, 'name')), format(n('curves')), format(points),
            figureText('labelled_share', points ? (labelled ?? 0) / points : undefined),
            ...kReasons.map((key) => format(n('undecided_points', key))),
            format(n('crossings')), figureText('sigma_px', n('curve_sigma_median_px')), figureText('saturated_pixels', n('saturated_pixels'))];
        }), 'What each camera saw; undecided curve points by reason'));
    }
    const perProjector = dig(report, 'points_by_projector');
    if (perProjector && typeof perProjector === 'object' && !Array.isArray(perProjector)) {
      const rows = Object.entries(perProjector).map(([name, value]) => {
        const judged = dig(figures, 'by_projector', name);
        const error = digNumber(judged, 'label_error');
        const recall = digNumber(judged, 'line_recall');
        return [name, figureText('points', typeof value === 'number' ? value : undefined), figureText('label_error', error), figureText('line_recall', recall)];
      });
      result.push(table(['Projector', 'Points', 'Label error', 'Line recall'], rows, 'What each projector gave'));
    }
    result.push(this.comparison(), wordList());
    const raw = {report, timing: details.timing, figures};
    result.push(h('details', {class: 'raw'}, h('summary', {}, 'All numbers (JSON)'),
      h('pre', {tabindex: 0}, JSON.stringify(raw, null, 1))));
    return result;
  }

  /** Runs over the same frame beside each other, where there are several. */
  private comparison(): HTMLElement {
    const {results} = this.app.source.index;
    const runs = new Set(results.map((r) => r.run));
    if (runs.size < 2) return h('div');
    const keys: FigureName[] = ['points', 'measured_share', 'label_error', 'line_recall', 'line_recall_3_5px',
      'distance_median_mm', 'completeness_1mm', 'total'];
    const shown = keys.filter((key) => results.some((r) => r.summary[key] !== undefined));
    const unit = this.app.rig?.unit ?? 'mm';
    return table(['Run', ...shown.map((key) => kFigures[key].name)],
      results.slice(0, 60).map((r) => [[r.run, r.name].filter(Boolean).join(' / '),
        ...shown.map((key) => figureText(key, r.summary[key], unit))]),
      'All runs beside each other');
  }

  private async files(): Promise<void> {
    const {app} = this;
    const {result} = app;
    const files = await app.source.files(result);
    if (app.result !== result || !files.length) return;
    byId('figures').append(h('details', {class: 'raw'}, h('summary', {}, `Files (${files.length})`),
      h('ul', {class: 'files'}, ...files.map(({path, bytes}) => h('li', {},
        h('a', {href: `files/${path.split('/').map(encodeURIComponent).join('/')}`, download: ''}, path),
        ` ${format(bytes / 1e6, 2)} MB`)))));
  }
}

const text = (value: Json | undefined): string => (typeof value === 'string' ? value : '–');

function spacing(band: string): string {
  return ({below_3px: 'below 3 px', '3_5px': '3–5 px', '5_8px': '5–8 px', '8_12px': '8–12 px',
    from_12px: 'from 12 px'} as Record<string, string>)[band] ?? words(band);
}
