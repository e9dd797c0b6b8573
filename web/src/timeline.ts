// Frames of a sequence, or runs of an experiment: thumbnails, playing, figures as curves, comparing.
import type {App} from './app';
import {Comparing} from './comparing';
import {rowName} from './data';
import {byId, format, h} from './dom';
import {figureText} from './figure_text';
import {Film} from './film';
import {FrameStrip} from './frame_strip';
import {Sequence} from './sequence';
import {TimeCurves} from './time_curves';
import {TimeMarks} from './time_marks';
import type {Viewer} from './viewer';

export class Timeline {
  private readonly root = byId('timeline');
  private readonly film: Film;
  private readonly strip: FrameStrip;
  private playing = 0; // number of the run that plays; 0: none
  private runs = 0;
  private at = 0; // the result in the picture
  private wanted = -1; // by scrubbing, while its mesh is read
  private sequence: Sequence | null = null;
  private curves: TimeCurves | null = null;
  private comparing: Comparing | null = null;
  private readonly play = h('button', {type: 'button', id: 'play', class: 'primary',
    onclick: () => void this.toggle()}, '▶ Play');
  private readonly speed = h('select', {id: 'speed', 'aria-label': 'Frames per second'},
    ...[2, 5, 10, 15, 25, 30].map((fps) => h('option', {value: fps, selected: fps === 10}, `${fps} / s`)));
  private readonly loop = h('input', {type: 'checkbox', id: 'loop', checked: true});
  private readonly faces = h('select', {id: 'play-faces', 'aria-label': 'Faces while playing',
    onchange: () => (this.film.faces = Number(this.faces.value))},
  ...[20, 50, 100].map((thousands) => h('option', {value: thousands}, `${thousands} k faces`)));
  private readonly slider = h('input', {type: 'range', min: 0, value: 0, id: 'frame-slider',
    'aria-label': 'Frame', onchange: () => this.choose(Number(this.slider.value), true),
    oninput: () => this.choose(Number(this.slider.value), false)});
  private readonly name = h('output', {class: 'frame-name', 'aria-live': 'off'});
  private readonly rate = h('output', {class: 'tool-label', id: 'play-rate'});

  constructor(private readonly app: App, private readonly viewer: Viewer) {
    const {source} = app;
    const {results, failed, mode} = source.index;
    this.film = new Film(source);
    this.strip = new FrameStrip(app);
    this.root.hidden = results.length < 2;
    if (results.length < 2) return;
    document.body.classList.add('with-timeline'); // which is in sight beside the pictures
    const sequence = new Set(results.map((r) => r.name)).size > 1;
    const playable = sequence && results.filter((r) => r.parts.includes('mesh')).length > 1;
    this.slider.max = String(results.length - 1);
    this.root.append(
      h('div', {class: 'timeline-tools'}, ...(playable ? [this.play, this.speed,
        mode === 'view' ? this.faces : null, h('label', {class: 'check'}, this.loop, 'Loop'), this.rate] : []),
      sequence ? this.slider : null, this.name, this.strip.note,
      failed.length ? h('a', {class: 'failed', href: '#failed-section'}, `${failed.length} without a result: ${
        failed.slice(0, 8).map(({run, frame}) => rowName(run, frame)).join(', ')}${failed.length > 8 ? ', …' : ''}`) : null),
      this.strip.element);
    app.on('result', () => this.shown());
    if (sequence) void this.readSequence();
  }

  private async readSequence(): Promise<void> {
    const {app} = this;
    const sequence = this.sequence = await Sequence.read(app.source);
    const chooseRow = (row: number, settled: boolean) => {
      const result = sequence.resultOf(row);
      if (result >= 0) this.choose(result, settled);
      else if (settled) this.name.textContent = `${sequence.name(row)} · no result`;
    };
    const marks = new TimeMarks(sequence, (row) => chooseRow(row, true));
    this.comparing = new Comparing(app, sequence);
    this.curves = new TimeCurves(sequence, app.rig?.unit ?? 'mm', chooseRow, this.comparing.tools);
    this.root.append(marks.track, this.curves.element, this.comparing.figures, marks.list);
    document.body.classList.add('with-curves');
    this.tell(app.result);
    this.root.dataset.sequence = 'read';
  }

  /** What is said of a frame that is in the picture. */
  private tell(i: number): void {
    const r = this.app.source.index.results[i];
    const share = r.summary.measured_share;
    this.slider.value = String(i);
    this.name.textContent = [[r.run, r.name].filter(Boolean).join(' / '),
      `${i + 1} of ${this.app.source.index.results.length}`, share === undefined ? '' : `${figureText('measured_share', share)} measured`]
      .filter(Boolean).join(' · ');
    const row = this.sequence?.rowOf(i) ?? -1;
    if (row >= 0) this.curves?.show(row);
    this.comparing?.show(row);
  }

  private shown(): void {
    this.at = this.app.result;
    this.strip.mark(this.at);
    this.tell(this.at);
  }

  /** Scrubs: the shape at once, all that belongs to it when the choice is settled. */
  private choose(i: number, settled: boolean): void {
    if (settled) {
      this.stop();
      this.wanted = -1;
      this.app.show(i);
      return;
    }
    this.tell(i);
    const busy = this.wanted >= 0;
    this.wanted = i;
    if (!busy) void this.scrub();
  }

  private async scrub(): Promise<void> {
    while (this.wanted >= 0) {
      const i = this.wanted;
      const mesh = await this.film.get(i);
      if (this.wanted < 0) return;
      if (mesh) this.viewer.play(mesh);
      if (this.wanted === i) this.wanted = -1;
    }
  }

  private stop(): void {
    this.playing = 0;
    this.play.textContent = '▶ Play';
    this.rate.textContent = '';
  }

  private async toggle(): Promise<void> {
    if (this.playing) {
      this.stop();
      this.app.show(this.at); // with all that belongs to it
      return;
    }
    this.playing = ++this.runs;
    this.play.textContent = '▮▮ Pause';
    this.at = this.app.result;
    await this.run(this.playing);
  }

  private async run(number: number): Promise<void> {
    const count = this.app.source.index.results.length;
    const moments: number[] = []; // when the last frames were drawn, ms
    let due = performance.now();
    while (this.playing === number) {
      if (this.at + 1 >= count && !this.loop.checked) return void this.toggle();
      const next = (this.at + 1) % count;
      const mesh = await this.film.get(next, Array.from({length: 8}, (_, k) => (next + 1 + k) % count));
      due = Math.max(due + 1000 / Number(this.speed.value), performance.now() - 200);
      await new Promise((done) => setTimeout(done, Math.max(0, due - performance.now())));
      if (this.playing !== number) return;
      this.at = next;
      if (mesh) this.viewer.play(mesh);
      this.tell(next);
      await new Promise((done) => requestAnimationFrame(done)); // the browser says how fast it can draw
      moments.push(performance.now());
      if (moments.length > 25) moments.shift();
      if (moments.length > 1) this.rate.textContent = `${format((1000 * (moments.length - 1)) / (moments[moments.length - 1] - moments[0]), 2)} / s`;
      this.root.dataset.played = String(Number(this.root.dataset.played ?? 0) + 1);
    }
  }
}
