// Thumbnails of all frames in a row; only those in sight are there.
import type {App} from './app';
import {isWrong} from './fault';
import {figureText} from './figure_text';
import {h} from './dom';

export class FrameStrip {
  readonly element: HTMLElement;
  readonly note: HTMLElement | null; // what a dot means
  private readonly items: HTMLButtonElement[];

  constructor(private readonly app: App) {
    const {results} = app.source.index;
    const sequence = new Set(results.map((r) => r.name)).size > 1;
    const partial = results.some((r) => r.detail === 'shape');
    const isOpenedLater = partial && results[0]?.detail === 'shape' && results.some((r) => r.detail !== 'shape');
    const best = results.reduce((most, r) => Math.max(most, r.summary.points ?? 0), 1);
    this.items = results.map((r, i) => {
      const {points, measured_share: share, warnings} = r.summary;
      const isFaulty = r.missing.some(({kind}) => isWrong(kind));
      const about = [share === undefined ? '' : `${figureText('measured_share', share)} measured`,
        points === undefined ? '' : `${figureText('points', points)} points`,
        warnings ? `${warnings} warnings` : '',
        partial ? (r.detail === 'full' ? 'with images and points' : 'shape only') : '',
        isFaulty ? 'parts are unreadable or in doubt' : r.missing.length ? 'parts are absent' : ''].filter(Boolean).join(', ');
      const title = [r.run, r.name].filter(Boolean).join(' / ');
      return h('button', {type: 'button', class: 'frame', title: `${title}: ${about}`,
        'aria-label': `${title}: ${about}`, onclick: () => app.show(i)},
      h('span', {class: 'thumb'}, r.parts.includes('thumb') ? null : 'no surface'),
      h('span', {class: 'quality', 'aria-hidden': 'true'},
        h('i', {style: `width:${100 * (share ?? (points ?? 0) / best)}%`})),
      h('span', {class: 'name'}, partial && r.detail === 'full' ? h('i', {class: 'whole'}) : null, sequence ? (r.run ? `${r.run} ${r.name}` : r.name) : r.run || r.name,
        warnings || isFaulty ? h('b', {class: 'alert', 'aria-hidden': 'true'}, '!') : null));
    });
    this.element = h('div', {class: 'frames', role: 'group', 'aria-label': sequence ? 'Frames' : 'Runs'}, ...this.items);
    this.note = partial ? h('span', {class: 'tool-label'}, h('i', {class: 'whole'}), `with images and points${isOpenedLater ? '; the page opened at the first of them' : ''}`) : null;
    this.lazyThumbs();
  }

  private lazyThumbs(): void {
    const observer = new IntersectionObserver((entries) => {
      for (const {isIntersecting, target} of entries) {
        const i = this.items.indexOf(target as HTMLButtonElement);
        const place = target.querySelector<HTMLElement>('.thumb')!;
        if (!this.app.source.has(i, 'thumb')) continue;
        if (isIntersecting) void this.fill(i, place);
        else this.empty(place);
      }
    }, {root: this.element, rootMargin: '300px'});
    for (const item of this.items) observer.observe(item);
  }

  private async fill(i: number, place: HTMLElement): Promise<void> {
    if (place.dataset.wanted) return;
    place.dataset.wanted = 'yes';
    const url = await this.app.source.imageUrl(i, 'thumb').catch(() => '');
    if (!url) return;
    // Who left and came back meanwhile has asked twice.
    if (place.dataset.wanted && !place.childElementCount) place.append(h('img', {src: url, alt: ''}));
    else URL.revokeObjectURL(url);
  }

  /** Out of sight: of a long sequence, all together would take much memory. */
  private empty(place: HTMLElement): void {
    delete place.dataset.wanted;
    const image = place.querySelector('img');
    if (image) URL.revokeObjectURL(image.src);
    image?.remove();
  }

  mark(result: number): void {
    this.items.forEach((item, k) => {
      if (k === result) item.setAttribute('aria-current', 'true');
      else item.removeAttribute('aria-current');
    });
    const {element} = this;
    const item = this.items[result];
    if (item) element.scrollLeft = item.offsetLeft - element.offsetLeft - element.clientWidth / 2 + item.clientWidth / 2;
  }
}
