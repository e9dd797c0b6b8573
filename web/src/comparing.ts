// Two frames compared: which one, how, and their figures beside each other.
import type {App, Reference} from './app';
import {choice, h} from './dom';
import {figureText, kFigures, type FigureName} from './figure_text';
import {table} from './charts';
import type {Sequence} from './sequence';

type How = 'off' | Reference['how'];

const kCompared: FigureName[] = ['points', 'labelled_share', 'crossing_px', 'measured_share', 'line_width_px',
  'line_height', 'saturated_pixels'];

export class Comparing {
  readonly tools: HTMLElement;
  readonly figures = h('div', {class: 'compared', hidden: true});
  private how: How = 'off';
  private other = -1; // result
  private row = -1;
  private readonly which = h('output', {class: 'tool-label'});
  private readonly pin = h('button', {type: 'button', id: 'pin', hidden: true, title: 'Compare with the frame shown now',
    onclick: () => this.compare(this.app.result)}, 'Take this frame');

  constructor(private readonly app: App, private readonly sequence: Sequence) {
    const how = choice<How>('Compare', [
      {value: 'off', text: 'Off'},
      {value: 'beside', text: 'Side by side', title: 'This frame on the left, the other one on the right'},
      {value: 'difference', text: 'Difference', title: 'How far this surface lies before the other one'},
    ], 'off', (value) => {
      this.how = value;
      const {results} = app.source.index;
      this.compare(this.other >= 0 ? this.other : app.result > 0 ? app.result - 1 : Math.min(1, results.length - 1));
    });
    this.tools = h('span', {class: 'tool-group'}, h('span', {class: 'tool-label'}, 'Compare'), how.element, this.which, this.pin);
  }

  /** The row shown now. */
  show(row: number): void {
    this.row = row;
    this.draw();
  }

  private compare(other: number): void {
    const {how} = this;
    this.other = how === 'off' ? -1 : other;
    this.app.compareWith(how === 'off' ? null : {result: other, how});
    this.draw();
  }

  private draw(): void {
    const {sequence, row} = this;
    const off = this.how === 'off';
    this.pin.hidden = this.figures.hidden = off;
    const other = sequence.rowOf(this.other);
    this.which.textContent = off || other < 0 ? '' : `with ${sequence.name(other)}`;
    if (off || other < 0 || row < 0) return this.figures.replaceChildren();
    const unit = this.app.rig?.unit ?? 'mm';
    const rows = kCompared.flatMap((figure) => {
      const [a, b] = [row, other].map((at) => sequence.column(figure)?.[at]);
      if (a === undefined && b === undefined) return [];
      const change = typeof a === 'number' && typeof b === 'number' ? a - b : null;
      const sign = change !== null && change > 0 ? '+' : '';
      return [[kFigures[figure].name, figureText(figure, a, unit), figureText(figure, b, unit),
        `${sign}${figureText(figure, change, unit)}`]];
    });
    this.figures.replaceChildren(table(['', sequence.name(row), sequence.name(other), 'Change'], rows, 'Two frames'));
  }
}
