// What helps to read the 3-D picture: scale bar, axes, bounding box, a plane that cuts.
import {Group, Plane, Vector3} from 'three';
import {clear, drawSegments} from './devices3d';
import type {Vec3} from './device';
import {h, svg} from './dom';
import {significant} from './figure_text';
import type {Picture3d} from './scene';

type Cut = 'none' | 'x' | 'y' | 'z' | 'view';

const kAxes: {name: string; direction: Vec3; color: string}[] = [
  {name: 'x', direction: [1, 0, 0], color: '#d1433f'},
  {name: 'y', direction: [0, 1, 0], color: '#2f9e44'},
  {name: 'z', direction: [0, 0, 1], color: '#3b7ddd'},
];
const kBarMost = 120; // CSS pixels
const kAxesSize = 56;

export interface Box {
  low: Vec3;
  high: Vec3;
}

export function boxOf(position: Float32Array): Box {
  const low: Vec3 = [Infinity, Infinity, Infinity];
  const high: Vec3 = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < position.length; ++i) {
    const k = i % 3;
    if (position[i] < low[k]) low[k] = position[i];
    if (position[i] > high[k]) high[k] = position[i];
  }
  return {low, high};
}

/** The longest of 1, 2, 5, 10, ... that is not longer. */
function niceLength(most: number): number {
  const unit = 10 ** Math.floor(Math.log10(most));
  return unit * ([5, 2].find((step) => step * unit <= most) ?? 1);
}

/** The twelve edges. */
function edges({low, high}: Box): number[] {
  const corner = (bits: number) => [0, 1, 2].map((k) => (bits & (1 << k) ? high[k] : low[k]));
  const segments: number[] = [];
  for (let bits = 0; bits < 8; ++bits) {
    for (const side of [1, 2, 4]) {
      if (!(bits & side)) segments.push(...corner(bits), ...corner(bits | side));
    }
  }
  return segments;
}

export class SpaceAids {
  readonly menu: HTMLElement;
  readonly overlay: HTMLElement;
  private readonly group = new Group();
  private picture: Picture3d | null = null;
  private box: Box | null = null;
  private unit = 'mm';
  private readonly bar = h('span', {class: 'scale-bar'});
  private readonly size = h('span', {class: 'box-size', hidden: true});
  private readonly axes = svg('svg', {class: 'axes', viewBox: '-28 -28 56 56', width: kAxesSize, height: kAxesSize, role: 'img',
    'aria-label': 'Directions of x, y and z'});
  private readonly showAids = h('input', {type: 'checkbox', id: 'show-aids', checked: true, onchange: () => this.update()});
  private readonly showBox = h('input', {type: 'checkbox', id: 'show-box', onchange: () => this.drawBox()});
  private readonly cut = h('select', {id: 'cut', onchange: () => this.applyCut()},
    ...([['none', 'no cut'], ['x', 'across x'], ['y', 'across y'], ['z', 'across z'], ['view', 'across the view']] as [Cut, string][])
      .map(([value, text]) => h('option', {value}, text)));
  private readonly depth = h('input', {type: 'range', id: 'cut-depth', min: 0, max: 1000, value: 500, hidden: true,
    'aria-label': 'Place of the cut', oninput: () => this.applyCut()});
  private readonly flip = h('input', {type: 'checkbox', id: 'cut-flip', onchange: () => this.applyCut()});
  private readonly flipLabel = h('label', {class: 'check', hidden: true}, this.flip, 'Other side');

  /** devices: a control that goes into the menu, too. */
  constructor(devices: HTMLElement) {
    this.menu = h('details', {class: 'menu'}, h('summary', {}, 'Space'), h('div', {class: 'menu-items'}, devices,
      h('label', {class: 'check'}, this.showAids, 'Scale and axes'),
      h('label', {class: 'check'}, this.showBox, 'Bounding box'),
      h('label', {class: 'tool-group'}, h('span', {class: 'tool-label'}, 'Cut'), this.cut), this.depth, this.flipLabel));
    this.overlay = h('div', {class: 'aids'}, this.size, this.bar, this.axes);
  }

  attach(picture: Picture3d): void {
    this.picture = picture;
    picture.helpers.add(this.group);
    picture.beforeRender = () => this.update();
  }

  /** What is in the picture now; null: nothing. */
  show(position: Float32Array | null, unit: string): void {
    this.box = position?.length ? boxOf(position) : null;
    this.unit = unit;
    this.drawBox();
    this.applyCut();
  }

  private drawBox(): void {
    const {box, unit} = this;
    clear(this.group);
    const shown = this.showBox.checked && box !== null;
    this.size.hidden = !shown;
    if (shown) {
      this.group.add(drawSegments(edges(box), 0x7a8794));
      this.size.textContent = `${box.high.map((x, k) => significant(x - box.low[k])).join(' × ')} ${unit}`;
      this.size.title = 'Size of the bounding box along x, y and z';
    }
    this.picture?.render();
  }

  private applyCut(): void {
    const {picture, box} = this;
    const cut = this.cut.value as Cut;
    this.depth.hidden = this.flipLabel.hidden = cut === 'none';
    if (!picture) return;
    if (cut === 'none' || !box) return picture.setCut(null);
    const normal = cut === 'view' ? picture.camera.getWorldDirection(new Vector3())
      : new Vector3(...kAxes.find(({name}) => name === cut)!.direction);
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((bits) =>
      new Vector3(...[0, 1, 2].map((k) => (bits & (1 << k) ? box.high[k] : box.low[k])) as Vec3).dot(normal));
    const [low, high] = [Math.min(...corners), Math.max(...corners)];
    const at = low + (Number(this.depth.value) / 1000) * (high - low);
    // What lies beyond the place along the normal stays, or what lies before it.
    picture.setCut(this.flip.checked ? new Plane(normal.negate(), at) : new Plane(normal, -at));
  }

  private update(): void {
    const {picture, bar, axes} = this;
    const shown = this.showAids.checked && this.box !== null;
    bar.hidden = !shown;
    axes.toggleAttribute('hidden', !shown);
    if (!picture || !shown) return;
    const perUnit = picture.pixelsPerUnit();
    if (perUnit > 0 && Number.isFinite(perUnit)) {
      const length = niceLength(kBarMost / perUnit);
      bar.style.width = `${length * perUnit}px`;
      bar.textContent = `${Number(length.toPrecision(1))} ${this.unit}`;
    }
    const e = picture.camera.matrixWorldInverse.elements; // its rows: right, up, towards the eye
    const seen = kAxes.map(({name, direction: [x, y, z], color}) => ({name, color,
      right: e[0] * x + e[4] * y + e[8] * z, up: e[1] * x + e[5] * y + e[9] * z, near: e[2] * x + e[6] * y + e[10] * z}));
    axes.replaceChildren(...seen.sort((a, b) => a.near - b.near).flatMap(({name, color, right, up}) => [
      svg('line', {x1: 0, y1: 0, x2: 17 * right, y2: -17 * up, stroke: color}),
      svg('text', {x: 23 * right, y: -23 * up}, name)]));
  }
}
