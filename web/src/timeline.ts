// Frames of a sequence, or runs of an experiment: thumbnails, quality, playing.
import type {App} from './app';
import type {Mesh} from './data';
import {byId, format, h, percent} from './dom';
import type {Viewer} from './viewer';

export class Timeline {
  private readonly root = byId('timeline');
  private items: HTMLButtonElement[] = [];
  private playing = false;
  private at = 0;
  private readonly meshes = new Map<number, Mesh>();
  private readonly play = h('button', {type: 'button', id: 'play', class: 'primary',
    onclick: () => void this.toggle()}, '▶ Play');
  private readonly speed = h('select', {'aria-label': 'Frames per second'},
    ...[2, 5, 10, 15, 30].map((fps) => h('option', {value: fps, selected: fps === 10}, `${fps} / s`)));
  private readonly slider = h('input', {type: 'range', min: 0, value: 0, id: 'frame-slider',
    'aria-label': 'Frame', onchange: () => this.app.show(Number(this.slider.value)),
    oninput: () => this.label(Number(this.slider.value))});
  private readonly name = h('output', {class: 'frame-name', 'aria-live': 'polite'});

  constructor(private readonly app: App, private readonly viewer: Viewer) {
    const {results, failed} = app.source.index;
    this.root.hidden = results.length < 2;
    if (results.length < 2) return;
    document.body.classList.add('with-timeline'); // which is in sight beside the pictures
    const sequence = new Set(results.map((r) => r.name)).size > 1;
    const playable = sequence && results.filter((r) => r.parts.includes('mesh')).length > 1;
    const strip = h('div', {class: 'frames', role: 'group', 'aria-label': sequence ? 'Frames' : 'Runs'});
    const quality = (i: number): number | undefined => results[i].summary.measured_share;
    const partial = results.some((r) => r.detail === 'shape');
    const best = Math.max(...results.map((r) => r.summary.points ?? 0), 1);
    this.items = results.map((r, i) => {
      const share = quality(i);
      const points = r.summary.points;
      const about = [share === undefined ? '' : `${percent(share, 0)} measured`,
        points === undefined ? '' : `${format(points)} points`,
        r.summary.warnings ? `${r.summary.warnings} warnings` : '',
        partial ? (r.detail === 'full' ? 'with images and points' : 'shape only') : '',
        r.missing.length ? 'parts are missing' : ''].filter(Boolean).join(', ');
      const title = [r.run, r.name].filter(Boolean).join(' / ');
      return h('button', {type: 'button', class: 'frame', title: `${title}: ${about}`,
        'aria-label': `${title}: ${about}`, onclick: () => app.show(i)},
      h('span', {class: 'thumb'}, r.parts.includes('thumb') ? null : 'no surface'),
      h('span', {class: 'quality', 'aria-hidden': 'true'},
        h('i', {style: `width:${100 * (share ?? (points ?? 0) / best)}%`})),
      h('span', {class: 'name'}, partial && r.detail === 'full' ? h('i', {class: 'whole'}) : null, sequence ? (r.run ? `${r.run} ${r.name}` : r.name) : r.run || r.name,
        r.summary.warnings || r.missing.length ? h('b', {class: 'alert', 'aria-hidden': 'true'}, '!') : null));
    });
    strip.append(...this.items);
    this.slider.max = String(results.length - 1);
    this.root.append(
      h('div', {class: 'timeline-tools'}, playable ? this.play : null, playable ? this.speed : null,
        sequence ? this.slider : null, this.name,
        partial ? h('span', {class: 'tool-label'}, h('i', {class: 'whole'}), 'with images and points') : null,
        failed.length ? h('span', {class: 'failed'}, `${failed.length} failed: ${failed.slice(0, 8).join(', ')}${
          failed.length > 8 ? ', …' : ''}`) : null),
      strip);
    this.lazyThumbs();
    app.on('result', () => this.mark());
  }

  private lazyThumbs(): void {
    const {source} = this.app;
    const observer = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        if (!entry.isIntersecting) continue;
        observer.unobserve(entry.target);
        const i = this.items.indexOf(entry.target as HTMLButtonElement);
        if (!source.has(i, 'thumb')) continue;
        void source.imageUrl(i, 'thumb').then((url) => {
          entry.target.querySelector('.thumb')!.append(h('img', {src: url, alt: ''}));
        }).catch(() => undefined);
      }
    }, {root: this.root.querySelector('.frames'), rootMargin: '300px'});
    for (const item of this.items) observer.observe(item);
  }

  private label(i: number): void {
    const r = this.app.source.index.results[i];
    const share = r.summary.measured_share;
    this.name.textContent = [[r.run, r.name].filter(Boolean).join(' / '),
      `${i + 1} of ${this.items.length}`, share === undefined ? '' : `${percent(share, 0)} measured`]
      .filter(Boolean).join(' · ');
  }

  private mark(): void {
    const i = this.app.result;
    this.items.forEach((item, k) => {
      if (k === i) item.setAttribute('aria-current', 'true');
      else item.removeAttribute('aria-current');
    });
    const strip = this.root.querySelector('.frames');
    const item = this.items[i];
    if (strip && item) {
      strip.scrollLeft = item.offsetLeft - (strip as HTMLElement).offsetLeft - strip.clientWidth / 2 + item.clientWidth / 2;
    }
    this.slider.value = String(i);
    this.label(i);
  }

  private async toggle(): Promise<void> {
    this.playing = !this.playing;
    this.play.textContent = this.playing ? '▮▮ Pause' : '▶ Play';
    if (!this.playing) {
      this.app.show(this.at); // with all that belongs to it
      return;
    }
    this.at = this.app.result;
    const {results} = this.app.source.index;
    while (this.playing) {
      const began = performance.now();
      const next = (this.at + 1) % results.length;
      const mesh = await this.meshOf(next);
      const wait = 1000 / Number(this.speed.value) - (performance.now() - began);
      await new Promise((done) => setTimeout(done, Math.max(0, wait)));
      if (!this.playing) return;
      this.at = next;
      if (mesh) this.viewer.play(mesh);
      this.slider.value = String(next);
      this.label(next);
      this.root.dataset.played = String(Number(this.root.dataset.played ?? 0) + 1);
    }
  }

  private async meshOf(i: number): Promise<Mesh | null> {
    const known = this.meshes.get(i);
    if (known) return known;
    if (!this.app.source.has(i, 'mesh')) return null;
    const mesh = await this.app.source.mesh(i, 'mesh', true).catch(() => null);
    if (mesh) this.meshes.set(i, mesh);
    const kept = 600;
    if (this.meshes.size > kept) this.meshes.delete(this.meshes.keys().next().value!);
    return mesh;
  }
}
