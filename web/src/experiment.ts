// What a script of experiments/ left: its tables, plots and pictures, and the runs within it.
// Pictures are shown as images only, so that nothing inside a drawing can run or load anything.
import type {App} from './app';
import {inflate} from './block';
import type {ExperimentJson, PictureJson, RunJson, Source, TableJson} from './data';
import {byId, format, h, percent} from './dom';
import {faultItem} from './fault';

const kShownRows = 60; // of a table, before it is folded

const plainNumber = /^-?\d+(\.\d+)?(e[-+]?\d+)?$/i;

/** Numbers with more digits than anyone reads are rounded; the whole number is its title. */
function cellOf(text: string, first: boolean): HTMLElement {
  const number = plainNumber.test(text);
  const long = number && text.length > 7 && !Number.isInteger(Number(text));
  const shown = text === '' ? '–' : long ? format(Number(text), 4) : text;
  // "90.0 (89.9 to 90.1)" and "-" are aligned as numbers are.
  const words = !/^[-–]?$|^-?\d/.test(text);
  const attributes = {class: words ? 'words' : undefined, title: long ? text : undefined};
  return first ? h('th', {scope: 'row', ...attributes}, shown) : h('td', attributes, shown);
}

/** titled: the caption stands above already. */
function dataTable(data: TableJson, caption: string, titled = false): HTMLElement {
  const words = data.header.map((_, k) => data.rows.some((row) => /[a-z]/i.test(row[k] ?? '') && !/^-?\d/.test(row[k] ?? '')));
  const cut = data.total > data.rows.length
    ? h('p', {class: 'tool-label'}, `The first ${format(data.rows.length)} of ${format(data.total)} rows; ${data.file} has all.`)
    : null;
  return h('div', {class: 'table-holder data-table', tabindex: 0, role: 'region', 'aria-label': caption},
    h('table', {}, titled ? null : h('caption', {}, h('span', {}, caption)),
      h('thead', {}, h('tr', {}, ...data.header.map((text, k) =>
        h('th', {scope: 'col', class: words[k] ? 'words' : undefined}, text.replace(/_/g, ' '))))),
      h('tbody', {}, ...data.rows.map((row) => h('tr', {}, ...row.map((text, k) => cellOf(text, k === 0)))))),
    cut);
}

function tables(data: ExperimentJson, title: string): HTMLElement[] {
  const own = data.tables.some(({file}) => !file.endsWith('.csv'));
  return data.tables.map((entry) => {
    const values = entry.file.endsWith('.csv');
    const caption = entry.title || (values ? `Values of ${entry.file}` : entry.file);
    if (!(values && own) && entry.rows.length <= kShownRows) return dataTable(entry, caption, caption === title);
    return h('details', {class: 'raw'}, h('summary', {}, `${caption} (${format(entry.total)} rows)`),
      dataTable(entry, caption));
  });
}

const nameOf = (file: string): string =>
  file.replace(/^.*\//, '').replace(/\.\w+$/, '').replace(/_/g, ' ');

/** Pictures one at a time, as large as the window allows. */
class Lightbox {
  private readonly image = h('img', {alt: ''});
  private readonly caption = h('p', {'aria-live': 'polite'});
  private readonly dialog = h('dialog', {class: 'lightbox', 'aria-label': 'Picture',
    onclick: (event: MouseEvent) => event.target === this.dialog && this.dialog.close(),
    onkeydown: (event: KeyboardEvent) => {
      const step = {ArrowRight: 1, ArrowLeft: -1}[event.key];
      if (step) this.show(this.at + step);
    }},
  this.image, h('div', {class: 'lightbox-tools'},
    h('button', {type: 'button', 'aria-label': 'Picture before', onclick: () => this.show(this.at - 1)}, '‹'),
    this.caption,
    h('button', {type: 'button', 'aria-label': 'Next picture', onclick: () => this.show(this.at + 1)}, '›'),
    h('button', {type: 'button', onclick: () => this.dialog.close()}, 'Close')));
  private readonly pictures: {url: string; file: string}[] = [];
  private at = 0;

  constructor() {
    document.body.append(this.dialog);
  }

  add(url: string, file: string): () => void {
    const at = this.pictures.push({url, file}) - 1;
    return () => {
      this.show(at);
      this.dialog.showModal();
    };
  }

  private show(at: number): void {
    this.at = (at + this.pictures.length) % this.pictures.length;
    const {url, file} = this.pictures[this.at];
    this.image.src = url;
    this.image.alt = nameOf(file);
    this.caption.textContent = `${file} · ${this.at + 1} of ${this.pictures.length}`;
  }
}

/** A picture that moves, with a button that stops it; still where less motion is wished for. */
async function moving(blob: Blob, url: string, name: string): Promise<HTMLElement> {
  const frame = await createImageBitmap(blob);
  const canvas = h('canvas', {width: frame.width, height: frame.height, role: 'img', 'aria-label': `${name}, first frame`});
  canvas.getContext('2d')!.drawImage(frame, 0, 0);
  const image = h('img', {alt: name, width: frame.width, height: frame.height});
  const button = h('button', {type: 'button', class: 'motion', onclick: () => play(image.hidden)});
  const play = (on: boolean) => {
    if (on) image.src = url;
    else image.removeAttribute('src');
    image.hidden = !on;
    canvas.hidden = on;
    button.textContent = on ? '▮▮ Pause' : '▶ Play';
  };
  play(!matchMedia('(prefers-reduced-motion: reduce)').matches);
  return h('div', {class: 'moving'}, canvas, image, button);
}

async function pictureOf(source: Source, entry: PictureJson, lightbox: Lightbox): Promise<HTMLElement> {
  const name = nameOf(entry.file);
  try {
    const packed = await source.picture(entry.part);
    const blob = new Blob([entry.packed ? await inflate(packed) : packed], {type: entry.type});
    const url = URL.createObjectURL(blob);
    const caption = h('figcaption', {}, entry.group ? entry.file.slice(entry.group.length + 1) : entry.file);
    if (entry.kind === 'video') {
      return h('figure', {class: 'picture'}, h('video', {src: url, controls: true, preload: 'metadata', 'aria-label': name}), caption);
    }
    if (entry.kind === 'moving') {
      return h('figure', {class: 'picture'}, await moving(blob, url, name), caption);
    }
    const image = h('img', {src: url, alt: name, width: entry.width, height: entry.height});
    await image.decode();
    const wide = image.naturalWidth > 2 * image.naturalHeight;
    return h('figure', {class: wide && !entry.group ? 'picture wide' : 'picture'},
      h('button', {type: 'button', class: 'enlarge', 'aria-label': `Enlarge ${name}`, onclick: lightbox.add(url, entry.file)}, image),
      caption);
  } catch (error) {
    return h('p', {class: 'verdict bad'}, `${entry.file} cannot be shown: ${String(error)}`);
  }
}

function runTable(runs: RunJson[], within: string): HTMLElement | null {
  if (!runs.length) return null;
  const columns: [string, (run: RunJson) => string][] = [
    ['points', ({summary}) => format(summary?.points)],
    ['measured', ({summary}) => percent(summary?.measured_share)],
    ['label error', ({summary}) => percent(summary?.label_error, 2)],
    ['line recall', ({summary}) => percent(summary?.line_recall)],
    ['distance, median', ({summary}) => format(summary?.distance_median_mm)],
    ['seconds', ({summary}) => format(summary?.total)],
    ['verdict', ({verdict, broken}) => (broken ? 'cannot be read' : verdict ?? '–')]];
  const shown = columns.filter(([, text]) => runs.some((run) => text(run) !== '–'));
  const kinds = {frame: 'one frame', scan: 'scan', calibration: 'calibration'};
  const caption = 'Other runs within this folder';
  return h('div', {class: 'table-holder data-table', tabindex: 0, role: 'region', 'aria-label': caption},
    h('table', {}, h('caption', {}, h('span', {}, caption)),
      h('thead', {}, h('tr', {}, ...['folder', 'what', ...shown.map(([name]) => name), 'its own page']
        .map((text) => h('th', {scope: 'col', class: /folder|what|page/.test(text) ? 'words' : undefined}, text)))),
      h('tbody', {}, ...runs.map((run) => h('tr', {},
        h('th', {scope: 'row', class: 'words'}, run.folder), h('td', {class: 'words'}, kinds[run.kind]),
        ...shown.map(([, text]) => h('td', {}, text(run))),
        h('td', {class: 'words'}, h('code', {}, run.report
          ? `${run.folder}/report.html` : `pencilscan report ${within}/${run.folder}`)))))));
}

function missing(data: ExperimentJson): HTMLElement | null {
  if (!data.missing.length) return null;
  return h('ul', {class: 'notes'}, ...data.missing.map((fault) => faultItem(fault)));
}

export function showExperiment(app: App): void {
  const {experiment, results} = app.source.index;
  byId('experiment-section').hidden = byId('experiment-link').hidden = !experiment;
  if (!experiment) return;
  byId('runs-link').hidden = results.length === 0;
  const heading = experiment.title || experiment.tables.find((t) => t.title)?.title || 'Experiment';
  byId('experiment-title').textContent = heading;
  const root = byId('experiment');
  const note = missing(experiment);
  if (experiment.setting || experiment.text) {
    root.append(h('p', {class: 'about'},
      experiment.setting ? h('span', {class: 'chip'}, `${experiment.setting} setting`) : null, experiment.text));
  }
  if (note) root.append(note);
  if (!experiment.tables.length && !experiment.pictures.length) {
    root.append(h('p', {}, 'This folder of an experiment holds no table and no picture that can be shown.'));
  }
  const all = tables(experiment, heading);
  const folded = all.filter((t) => t.tagName === 'DETAILS');
  const own = h('div', {class: 'pictures', id: 'own-pictures', hidden: true});
  const strips = h('div', {class: 'strips'});
  root.append(h('div', {class: 'tables-and-pictures'},
    h('div', {class: 'tables'}, ...all.filter((t) => t.tagName !== 'DETAILS')), own), strips);
  const runs = runTable(experiment.runs, experiment.folder);
  if (runs) root.append(runs);
  root.append(...folded);
  const {commands, commands_total: total = 0} = experiment;
  if (commands.length) {
    const more = total > commands.length ? `\n… and ${format(total - commands.length)} more in commands.log` : '';
    root.append(h('details', {class: 'raw'}, h('summary', {}, `Commands that were run (${format(total)})`),
      h('pre', {tabindex: 0}, commands.join('\n') + more)));
  }
  void pictures(app.source, experiment, own, strips);
}

/** All pictures in their order: small ones beside the tables, wide ones below, folders as strips. */
async function pictures(
  source: Source, experiment: ExperimentJson, own: HTMLElement, strips: HTMLElement,
): Promise<void> {
  const lightbox = new Lightbox();
  const groups = new Map<string, HTMLElement>();
  const wide = h('div', {class: 'pictures'});
  strips.before(wide);
  for (const entry of experiment.pictures) {
    const figure = await pictureOf(source, entry, lightbox);
    if (!entry.group) {
      (figure.classList.contains('wide') ? wide : own).append(figure);
      own.hidden = own.childElementCount === 0;
      continue;
    }
    let strip = groups.get(entry.group);
    if (!strip) {
      strip = h('div', {class: 'strip', tabindex: 0, role: 'region', 'aria-label': `Pictures in ${entry.group}`});
      groups.set(entry.group, strip);
      strips.append(h('h3', {}, `${entry.group}/`), strip);
    }
    strip.append(figure);
  }
  document.documentElement.dataset.pictures = String(experiment.pictures.length);
}
