// What is known of the selected point, in words, and how every camera sees it.
import type {App} from './app';
import {byId, h} from './dom';
import {extentOf, figureText, placeText} from './figure_text';
import {css, kStates, lightColor} from './palette';

const kCrop = 44; // image px shown around the point
const kSide = 88; // CSS px of a crop

export class Inspector {
  private readonly root = byId('inspector');
  private shown = 0; // times

  constructor(private readonly app: App) {
    app.on('selection', () => this.show());
    app.on('curves', () => this.show());
  }

  private show(): void {
    const {app} = this;
    const {selection} = app;
    ++this.shown;
    this.root.replaceChildren();
    this.root.classList.toggle('empty', !selection);
    if (!selection) {
      const can = app.points !== null || app.curves !== null;
      this.root.append(h('p', {}, can
        ? 'Click a curve in the image or a place on the shape: its measurement appears here, in 3-D and in the other cameras.'
        : app.source.has(app.result, 'points') || app.source.has(app.result, 'curves')
          ? 'Points and curves are being read.' : 'This result holds no points and no curves to select.'));
      return;
    }
    const facts = h('dl', {class: 'facts'});
    const fact = (name: string, ...value: (string | Node)[]) =>
      facts.append(h('div', {}, h('dt', {}, name), h('dd', {'data-fact': name}, ...value)));
    fact('Camera', app.cameras[selection.camera]?.name ?? `#${selection.camera}`);
    fact('Pixel', `${selection.u.toFixed(2)}, ${selection.v.toFixed(2)}`);
    if (selection.point >= 0) this.pointFacts(fact);
    if (selection.sample >= 0) this.sampleFacts(fact, selection.point < 0);
    const buttons = h('div', {class: 'inspector-buttons'});
    if (selection.point >= 0) {
      buttons.append(
        h('button', {type: 'button', onclick: () => app.step(-1), title: 'Previous point of this line ([)'}, '‹ along line'),
        h('button', {type: 'button', onclick: () => app.step(1), title: 'Next point of this line (])'}, 'along line ›'));
    }
    buttons.append(h('button', {type: 'button', onclick: () => app.clearSelection()}, 'Clear'));
    this.root.append(facts, buttons);
    if (selection.point >= 0) void this.crops();
  }

  private pointFacts(fact: (name: string, ...value: (string | Node)[]) => void): void {
    const {app} = this;
    const points = app.points!;
    const i = app.selection!.point;
    const projector = points.projector[i];
    const pattern = app.patternOf(i);
    const unit = app.rig?.unit ?? 'mm';
    fact('Projector', app.rig?.projectors[projector]?.name ?? `#${projector}`,
      app.rig && app.rig.patterns[projector]?.length > 1 ? `, pattern ${points.pattern[i]}` : '');
    const line = points.line[i];
    if (pattern) {
      const color = pattern.colors[pattern.sequence[line % pattern.sequence.length]];
      fact('Line', `${line} of ${pattern.lines} `,
        h('i', {class: 'swatch', style: `background:${css(lightColor(color))}`}), ` ${color}, local ID ${line % pattern.sequence.length}`);
    } else fact(app.source.index.results[app.result]?.scan ? 'Panel column or row' : 'Line', String(line));
    fact('3-D point', `${placeText(app.position(i), extentOf(app.rig))} ${unit}`);
    fact('Sigma', figureText('sigma', points.sigma[i], unit));
    fact('Confidence', figureText('confidence', points.confidence[i] / 255));
    if (points.distance) fact('Distance to truth', figureText('distance', points.distance[i], unit));
    fact('Vertex', `${i * points.stride} of points.ply`);
  }

  private sampleFacts(fact: (name: string, ...value: (string | Node)[]) => void, alone: boolean): void {
    const {app} = this;
    const curves = app.curves!;
    const i = app.selection!.sample;
    const {name, about} = kStates[curves.state[i]] ?? kStates[5];
    if (alone) fact('State', `${name}: ${about}`);
    const colors = app.rig?.families[curves.family[i]] ?? [];
    const color = colors[curves.color[i]];
    if (colors.length > 1) {
      const lead = curves.lead[i] / 10;
      fact('Code evidence', h('i', {class: 'swatch', style: `background:${css(lightColor(color))}`}),
        ` ${color}, ${lead >= 25.5 ? '> 25' : lead.toFixed(1)} nats over ${
          colors.length === 2 ? colors[1 - curves.color[i]] : 'the next'}`);
    } else fact('Code evidence', 'lines without a code');
    fact('Curve', `${curves.curve[i]}, sigma ${figureText('sigma_px', curves.sigma_px[i] / 500)} across`);
  }

  /** The surroundings of the point in every camera that looks there. */
  private async crops(): Promise<void> {
    const {app} = this;
    const mine = this.shown;
    const row = h('div', {class: 'crops', role: 'group', 'aria-label': 'The point in the cameras'});
    this.root.append(row);
    const {result} = app;
    const at = app.position(app.selection!.point);
    for (let c = 0; c < app.cameras.length; ++c) {
      const own = app.selection!.camera === c;
      const seen = app.sees(c, ...at);
      if (!seen || !app.source.has(result, `image/${c}`)) continue;
      const image = await app.source.image(result, `image/${c}`).catch(() => null);
      if (mine !== this.shown || !image) return;
      const ratio = Math.min(devicePixelRatio, 2);
      const canvas = h('canvas', {width: kSide * ratio, height: kSide * ratio});
      const context = canvas.getContext('2d')!;
      const scale = image.width / app.cameras[c].width;
      const side = kCrop * scale;
      context.imageSmoothingEnabled = false;
      context.drawImage(image, (seen.u + 0.5) * scale - side / 2, (seen.v + 0.5) * scale - side / 2,
        side, side, 0, 0, canvas.width, canvas.height);
      context.lineWidth = 2 * ratio;
      context.strokeStyle = '#ff3d6e';
      context.beginPath();
      context.arc(canvas.width / 2, canvas.height / 2, 8 * ratio, 0, 7);
      context.stroke();
      const state = own ? 'source' : seen.visible === false ? 'hidden' : seen.visible ? 'visible' : 'unknown';
      row.append(h('figure', {'data-state': state, 'data-camera': app.cameras[c].name}, canvas, h('figcaption', {},
        `${app.cameras[c].name}${own ? ' (measured)' : state === 'hidden' ? ' (hidden)' : ''}`)));
    }
  }
}
