// What is not as it should be in a result or an experiment (src/pencilscan/page/fault.h).
import {h} from './dom';

export interface FaultJson {
  what: string;
  why: string;
  kind: 'missing' | 'unreadable' | 'doubtful' | 'note';
}

/** Whether something is wrong: what is absent need not have been asked for, as pictures of --no-pictures. */
export const isWrong = (kind: FaultJson['kind']): boolean => kind === 'unreadable' || kind === 'doubtful';

const kHeads = {missing: 'Missing', unreadable: 'Cannot be read', doubtful: 'In doubt', note: 'Note'};

/** An item of a list of warnings. */
export function faultItem({what, why, kind}: FaultJson, name = what): HTMLElement {
  return h('li', {class: isWrong(kind) ? 'warning' : 'absent'},
    h('strong', {}, `${kHeads[kind]}: ${name}`), h('p', {}, why.replace(/^unreadable: /, '')));
}
