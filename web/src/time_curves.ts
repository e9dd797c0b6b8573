// The figures of a sequence as curves over its frames, one small picture a figure.
import {figureText, kFigures, type FigureName} from './figure_text';
import {h, svg} from './dom';
import type {Sequence} from './sequence';

const kShown: FigureName[] = ['points', 'labelled_share', 'crossing_px', 'measured_share', 'line_width_px', 'saturated_pixels'];
const kSide = 1000; // of a curve's picture, stretched to its place

interface Curve {
  figure: FigureName;
  values: (number | null)[];
  value: HTMLElement;
  cursor: HTMLElement;
}

/** Lines through neighbours that are known; a value alone is a dot. */
function pathOf(values: (number | null)[], rows: number, low: number, high: number): string {
  let path = '';
  let drawing = false;
  for (let row = 0; row < rows; ++row) {
    const value = values[row] ?? null;
    if (value !== null) {
      const [x, y] = [((row + 0.5) / rows) * kSide, kSide * (1 - (value - low) / (high - low))];
      path += `${drawing ? 'L' : 'M'}${x.toFixed(1)} ${y.toFixed(1)}`;
      if (!drawing && (values[row + 1] ?? null) === null) path += 'h.1';
    }
    drawing = value !== null;
  }
  return path;
}

export class TimeCurves {
  readonly element = h('div', {class: 'time-curves'});
  private readonly grid = h('div', {class: 'curve-grid'});
  private readonly deviceSelect = h('select', {id: 'curve-device', onchange: () => this.draw()});
  private curves: Curve[] = [];
  private row = 0;

  /** choose: a row was pointed at; settled: for good. beside: more for the line above the curves. */
  constructor(private readonly sequence: Sequence, private readonly unit: string,
      private readonly choose: (row: number, settled: boolean) => void, ...beside: HTMLElement[]) {
    const devices = sequence.devices.filter((device) => kShown.some((figure) => sequence.column(figure, device)));
    this.deviceSelect.append(h('option', {value: ''}, 'all together'), ...devices.map((device) => h('option', {value: device}, device)));
    this.element.append(
      h('div', {class: 'curve-head'},
        h('strong', {}, 'Figures over time'),
        devices.length ? h('label', {class: 'tool-group'}, h('span', {class: 'tool-label'}, 'of'), this.deviceSelect) : null,
        ...beside, sequence.remark ? h('span', {class: 'tool-label'}, sequence.remark) : null),
      this.grid);
    this.draw();
  }

  show(row: number): void {
    this.row = row;
    for (const {figure, values, value, cursor} of this.curves) {
      value.textContent = figureText(figure, values[row], this.unit);
      cursor.style.transform = `translateX(${(100 * (row + 0.5)) / this.sequence.length}%)`; // of its width: nothing is drawn anew
    }
  }

  private draw(): void {
    const device = this.deviceSelect.value;
    this.curves = [];
    this.grid.replaceChildren();
    for (const figure of kShown) {
      const values = this.sequence.column(figure, device);
      if (values) this.grid.append(this.picture(figure, values, device));
    }
    this.show(this.row);
  }

  private picture(figure: FigureName, values: (number | null)[], device: string): HTMLElement {
    const {sequence, unit} = this;
    const expected = figure === 'crossing_px' ? sequence.column('crossing_expected_px', device) : undefined;
    const known = [...values, ...(expected ?? [])].filter((x): x is number => x !== null);
    const [low, high] = [known.reduce((a, b) => Math.min(a, b)), known.reduce((a, b) => Math.max(a, b))];
    const margin = high > low ? 0.06 * (high - low) : Math.abs(high) || 1;
    const path = (of: (number | null)[], name: string) => svg('path', {class: name,
      d: pathOf(of, sequence.length, low - margin, high + margin), 'vector-effect': 'non-scaling-stroke'});
    const {name} = kFigures[figure];
    const [lowText, highText] = [figureText(figure, low, unit), figureText(figure, high, unit)];
    const picture = svg('svg', {viewBox: `0 0 ${kSide} ${kSide}`, preserveAspectRatio: 'none', role: 'img',
      'aria-label': `${name}: from ${lowText} to ${highText}`},
    ...this.marks(), expected ? path(expected, 'expected') : null, path(values, 'curve'));
    const cursor = h('i', {class: 'cursor'});
    const value = h('output', {'data-figure': figure});
    this.curves.push({figure, values, value, cursor});
    const area = h('div', {class: 'curve-area'}, picture, cursor);
    this.listen(area);
    return h('figure', {class: 'time-curve'}, h('figcaption', {}, h('span', {}, name),
      high > low ? h('span', {class: 'range'}, `${lowText} to ${highText}`) : null,
      expected ? h('span', {class: 'tool-label'}, '– – noise') : null, value), area);
  }

  /** Events and holes, behind the curve. */
  private marks(): SVGElement[] {
    const {sequence} = this;
    const at = (row: number) => (row / sequence.length) * kSide;
    return sequence.marks.filter(({kind}) => kind !== 'warning').map(({kind, first, last}) =>
      svg('rect', {class: `mark-${kind}`, x: at(first), width: Math.max(3, at(last + 1) - at(first)), y: 0, height: kSide}));
  }

  private listen(area: HTMLElement): void {
    const row = (event: PointerEvent) => {
      const {left, width} = area.getBoundingClientRect();
      const share = (event.clientX - left) / width;
      return Math.max(0, Math.min(this.sequence.length - 1, Math.floor(share * this.sequence.length)));
    };
    let held = false;
    area.addEventListener('pointerdown', (event) => {
      held = true;
      area.setPointerCapture(event.pointerId);
      this.choose(row(event), false);
    });
    area.addEventListener('pointermove', (event) => {
      if (held) this.choose(row(event), false);
    });
    area.addEventListener('pointerup', (event) => {
      if (held) this.choose(row(event), true);
      held = false;
    });
    area.addEventListener('pointercancel', () => (held = false));
  }
}
