// Events, warnings and frames without a result: marks above the curves, and as a list.
import {h} from './dom';
import type {Sequence, TimeMark} from './sequence';

const kWords = {event: 'event', hole: 'no result', warning: 'warning'};
const kMost = 200; // in the list

export class TimeMarks {
  readonly track = h('div', {class: 'mark-track', 'aria-hidden': 'true'});
  readonly list = h('details', {class: 'mark-list'});

  constructor(private readonly sequence: Sequence, choose: (row: number) => void) {
    const {marks} = sequence;
    this.track.hidden = this.list.hidden = marks.length === 0;
    const at = (row: number) => (100 * row) / sequence.length;
    this.track.append(...marks.map((mark) => h('i', {class: mark.kind, title: this.textOf(mark),
      style: `left:${at(mark.first)}%;width:${at(mark.last + 1) - at(mark.first)}%`, onclick: () => choose(mark.first)})));
    const counts = (['event', 'hole', 'warning'] as const).flatMap((kind) => {
      const count = marks.filter((mark) => mark.kind === kind).length;
      return count ? [`${count} ${kind === 'hole' ? 'without a result' : `${kWords[kind]}${count > 1 ? 's' : ''}`}`] : [];
    });
    this.list.append(h('summary', {}, `Marks: ${counts.join(', ')}`),
      h('ul', {}, ...marks.slice(0, kMost).map((mark) => h('li', {class: mark.kind},
        h('button', {type: 'button', onclick: () => choose(mark.first)}, this.framesOf(mark)),
        h('span', {}, h('b', {}, kWords[mark.kind]), ` ${mark.text}`))),
      marks.length > kMost ? h('li', {}, `and ${marks.length - kMost} more`) : null));
  }

  private framesOf({first, last}: TimeMark): string {
    const {sequence} = this;
    return first === last ? sequence.name(first) : `${sequence.name(first)} – ${sequence.name(last)}`;
  }

  private textOf(mark: TimeMark): string {
    return `${this.framesOf(mark)}: ${kWords[mark.kind]}: ${mark.text}`;
  }
}
