import {App} from './app';
import {showCalibrations} from './calibration';
import {Source} from './data';
import {byId, h} from './dom';
import {showExperiment} from './experiment';
import {showFailedFrames} from './failed_frames';
import {figureText} from './figure_text';
import {Figures} from './figures';
import {Images} from './images';
import {Inspector} from './inspector';
import {Timeline} from './timeline';
import {Viewer} from './viewer';

function themeButton(app: App): void {
  const root = document.documentElement;
  const button = byId<HTMLButtonElement>('theme');
  const dark = matchMedia('(prefers-color-scheme: dark)');
  const set = (theme: string) => {
    root.dataset.theme = theme;
    button.setAttribute('aria-label', theme === 'dark' ? 'Light colours' : 'Dark colours');
    button.textContent = theme === 'dark' ? '☀' : '☾';
    app.tell('theme');
  };
  set(dark.matches ? 'dark' : 'light');
  dark.addEventListener('change', () => set(dark.matches ? 'dark' : 'light'));
  button.addEventListener('click', () => set(root.dataset.theme === 'dark' ? 'light' : 'dark'));
}

function header(app: App): void {
  const {index} = app.source;
  document.title = `${index.title} – pencilscan`;
  byId('title').textContent = index.title;
  byId('program').textContent = index.program;
  const chips = byId('chips');
  const show = () => {
    const found = index.results[app.result];
    const texts = [
      index.results.length > 1 ? `${index.results.length} results` : null,
      found ? [found.run, found.name].filter(Boolean).join(' / ') : null,
      found?.summary.points !== undefined ? `${figureText('points', found.summary.points)} points` : null,
      found?.summary.measured_share !== undefined ? `${figureText('measured_share', found.summary.measured_share)} measured` : null,
    ];
    chips.replaceChildren(...texts.filter(Boolean).map((text) => h('span', {class: 'chip'}, text)));
  };
  app.on('result', show);
}

/** Phones show one panel at a time. */
function tabs(): void {
  const stage = byId('stage');
  const buttons = [...document.querySelectorAll<HTMLButtonElement>('#panel-tabs button')];
  const show = (panel: string) => {
    stage.dataset.panel = panel;
    for (const b of buttons) b.setAttribute('aria-pressed', String(b.dataset.panel === panel));
  };
  for (const b of buttons) b.addEventListener('click', () => show(b.dataset.panel!));
  show('viewer');
}

function start(): void {
  const app = new App(new Source());
  const {index} = app.source;
  tabs();
  header(app);
  const viewer = new Viewer(app);
  new Images(app);
  new Inspector(app);
  new Figures(app);
  new Timeline(app, viewer);
  themeButton(app);
  showCalibrations(app);
  showExperiment(app);
  showFailedFrames(app);
  const nothing = index.results.length === 0;
  document.body.classList.toggle('without-results', nothing);
  if (nothing) document.querySelector('.skip')!.setAttribute('href', index.experiment ? '#experiment-section' : index.failed.length ? '#failed-section' : '#calibration-section');
  if (nothing) {
    const text = index.calibrations.length || index.experiment || index.failed.length ? '' :
      'This folder holds no result: no points.ply, mesh.ply or report.json of a frame was found in it or in its folders.';
    byId('nothing').textContent = text;
    byId('nothing').hidden = !text;
  } else {
    // The first one that has everything: of long sequences, some have their shape only.
    app.show(Math.max(0, index.results.findIndex((result) => result.detail !== 'shape')));
    app.on('result', () => void later(app));
    void later(app);
  }
  if (nothing) document.documentElement.dataset.loaded = 'nothing';
  document.documentElement.dataset.ready = 'true';
}

/** The shape first, then what belongs to it. */
async function later(app: App): Promise<void> {
  await new Promise((done) => setTimeout(done, 30));
  await app.loadMeasurements();
  document.documentElement.dataset.loaded = String(app.result);
}

start();
