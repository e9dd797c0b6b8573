// Histograms and bars as SVG, each with a text that says the same.
import type {HistogramJson} from './data';
import {format, h, svg} from './dom';
import {significant} from './figure_text';

export function histogramChart(
  title: string, data: HistogramJson, unit: string,
  marks: {at: number; text: string}[] = [],
): HTMLElement {
  const [width, height, bottom, top] = [320, 150, 22, 8];
  const most = Math.max(1, ...data.counts);
  const bin = width / data.counts.length;
  const y = (count: number) => (height - bottom - top) * (1 - count / most) + top;
  const words = `${title}: median ${significant(data.median)} ${unit}, 90 % below ${significant(data.p90)} ${unit}` +
    (data.above ? `, ${format(data.above)} of ${format(data.count)} above ${format(data.high)} ${unit}` : '');
  const picture = svg('svg', {viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': words});
  data.counts.forEach((count, i) => {
    const low = (i * data.high) / data.counts.length;
    const high = ((i + 1) * data.high) / data.counts.length;
    picture.append(svg('rect', {x: i * bin + 0.5, y: y(count), width: Math.max(1, bin - 1),
      height: height - bottom - y(count), class: 'column'},
    svg('title', {}, `${format(low)} – ${format(high)} ${unit}: ${format(count)}`)));
  });
  for (const {at, text} of [{at: data.median, text: 'median'}, ...marks]) {
    if (at > data.high) continue;
    const x = (at / data.high) * width;
    picture.append(svg('line', {x1: x, x2: x, y1: top, y2: height - bottom, class: 'mark'}),
      svg('text', {x: x > width * 0.75 ? x - 3 : x + 3, y: top + 9, class: 'mark-text',
        'text-anchor': x > width * 0.75 ? 'end' : 'start'}, text));
  }
  for (const share of [0, 0.25, 0.5, 0.75, 1]) {
    const anchor = share === 0 ? 'start' : share === 1 ? 'end' : 'middle';
    picture.append(svg('text', {x: share * width, y: height - 7, 'text-anchor': anchor, class: 'tick'},
      `${format(share * data.high, 2)}${share === 1 ? ` ${unit}` : ''}`));
  }
  return h('figure', {class: 'chart'}, h('figcaption', {}, h('strong', {}, title), ` ${
    format(data.count)} values, median ${significant(data.median)} ${unit}`), picture);
}

/** Horizontal bars: [name, value, text]. about: what a name means. */
export function bars(title: string, rows: [string, number, string][], highest?: number,
    about: (name: string) => string | undefined = () => undefined): HTMLElement {
  const most = highest ?? Math.max(1e-12, ...rows.map(([, value]) => value));
  return h('figure', {class: 'chart'}, h('figcaption', {}, h('strong', {}, title)),
    h('div', {class: 'bars', role: 'list'}, ...rows.map(([name, value, text]) =>
      h('div', {class: 'bar-row', role: 'listitem'}, h('span', {class: 'bar-name', title: about(name)}, name),
        h('span', {class: 'bar-track'},
          h('span', {style: `width:${Math.max(0, Math.min(100, (100 * value) / most))}%`})),
        h('span', {class: 'bar-value'}, text)))));
}

export interface Tile {
  name: string;
  value: string;
  hint?: string;
}

/** Key figures. */
export function tiles(list: Tile[]): HTMLElement {
  return h('dl', {class: 'tiles'}, ...list.map(({name, value, hint}) =>
    h('div', {class: 'tile'}, h('dt', {}, name), h('dd', {}, value), hint ? h('dd', {class: 'hint'}, hint) : null)));
}

export function table(head: string[], rows: (string | number)[][], caption: string): HTMLElement {
  return h('div', {class: 'table-holder', tabindex: 0, role: 'region', 'aria-label': caption},
    h('table', {}, h('caption', {}, h('span', {}, caption)),
      h('thead', {}, h('tr', {}, ...head.map((text) => h('th', {scope: 'col'}, text)))),
      h('tbody', {}, ...rows.map((row) => h('tr', {}, ...row.map((cell, i) =>
        i === 0 ? h('th', {scope: 'row'}, cell) : h('td', {}, cell)))))));
}
