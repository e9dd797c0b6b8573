// What is not as it should be in a result or an experiment (src/pencilscan/page/fault.h).
import {h} from './dom';

export interface FaultJson {
  what: string;
  why: string;
  kind: 'missing' | 'unreadable' | 'doubtful' | 'note';
}

const kHeads = {missing: 'Missing', unreadable: 'Cannot be read', doubtful: 'In doubt', note: 'Note'};

/** An item of a list of warnings. */
export function faultItem({what, why, kind}: FaultJson, name = what): HTMLElement {
  return h('li', {class: kind === 'missing' || kind === 'note' ? 'absent' : 'warning'},
    h('strong', {}, `${kHeads[kind]}: ${name}`), h('p', {}, why.replace(/^unreadable: /, '')));
}
