// The legend over the 3-D picture; ends of scales can be typed, or fitted to the data again.
import {scaled, type Legend, type Range, type Ranges, type Scaled} from './coloring';
import {format, h} from './dom';
import {css} from './palette';

export class LegendPanel {
  readonly element = h('div', {class: 'legend', hidden: true});
  readonly ranges: Ranges = {sigma: {low: 0, high: 1}, confidence: {low: 0, high: 1},
    distance: {low: 0, high: 1}, difference: {low: -1, high: 1}};
  private readonly typed = new Set<Scaled>();

  constructor(private readonly changed: () => void) {}

  /** A new fit, unless somebody typed another range. */
  fit(mode: Scaled, range: Range): void {
    if (!this.typed.has(mode)) this.ranges[mode] = range;
  }

  show(legend: Legend | null): void {
    this.element.hidden = legend === null;
    if (!legend || this.element.contains(document.activeElement)) return; // somebody is typing
    this.element.replaceChildren(h('strong', {}, legend.title));
    for (const {name, color, about} of legend.named ?? []) {
      this.element.append(h('span', {class: 'key', title: about}, h('i', {style: `background:${css(color)}`}), name));
    }
    if (legend.scale) this.element.append(...this.scale(legend.scale, legend.unit ?? ''));
  }

  private scale(mode: Scaled, unit: string): HTMLElement[] {
    const range = this.ranges[mode];
    const stops = [0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1]
      .map((x) => css(scaled(mode, range.low + x * (range.high - range.low), range)));
    const end = (which: 'low' | 'high', name: string) => {
      const input = h('input', {type: 'number', step: 'any', value: range[which], 'aria-label': name,
        'data-end': which, onchange: () => {
          const value = Number(input.value);
          const other = which === 'low' ? value < range.high : value > range.low;
          if (input.value === '' || !Number.isFinite(value) || !other) {
            input.value = String(range[which]);
            return;
          }
          this.typed.add(mode);
          this.ranges[mode] = {...range, [which]: value};
          input.blur();
          this.changed();
        }});
      return input;
    };
    const fit = h('button', {type: 'button', title: 'Fit the colours to the data', onclick: () => {
      this.typed.delete(mode);
      fit.blur();
      this.changed();
    }}, 'Fit');
    return [end('low', 'Low end of the colours'),
      h('span', {class: 'ramp', style: `background:linear-gradient(90deg,${stops.join(',')})`,
        title: `Middle: ${format((range.low + range.high) / 2)} ${unit}`}),
      end('high', 'High end of the colours'), h('span', {}, unit), fit];
  }
}
