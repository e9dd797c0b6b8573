// Frames that have no result, each with the reason and what to do.
import type {App} from './app';
import {rowName} from './data';
import {byId, h} from './dom';

const kMost = 50; // in the list

export function showFailedFrames(app: App): void {
  const {failed} = app.source.index;
  byId('failed-section').hidden = failed.length === 0;
  byId('failed-count').textContent = String(failed.length);
  byId('failed').append(
    ...failed.slice(0, kMost).map((frame) => h('li', {class: 'warning'}, h('strong', {}, `Frame ${rowName(frame.run, frame.frame)}`),
      h('p', {}, frame.why), frame.action ? h('p', {}, frame.action) : null)),
    ...(failed.length > kMost ? [h('li', {class: 'absent'}, `and ${failed.length - kMost} more`)] : []));
}
