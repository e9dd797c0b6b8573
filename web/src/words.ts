// What the words of the page mean.
import {h} from './dom';
import {kFigures, type FigureText} from './figure_text';
import {kHoles, kStates} from './palette';

/** Stages, as timing.json names them. */
export const kStageWords: Record<string, string> = {
  reading: 'pictures are read from their files',
  detection: 'curves are found in the pictures',
  grid: 'crossings of curves become a grid for each camera',
  solution: 'it is decided which projected line each curve is',
  refinement: 'the poses of the devices are corrected where crossings miss each other',
  'guided matching': 'lines that the labelled surface lets expect are looked for: they confirm, adopt and find what the solution missed',
  triangulation: 'rays of the cameras meet the light planes of the lines',
  depth: 'between the curves, depth is fitted to the light of all projectors',
  surface: 'depth of all cameras becomes one closed surface',
  'guided matching on the surface': 'the closed surface removes labels that contradict it, and tells where missing lines are',
  confirmation: 'what no labelled point supports no longer counts as measured',
  holes: 'places of the surface that nobody measured get their reason',
  color: 'the surface gets its albedo',
  pictures: 'pictures of the result are drawn',
};

const kTerms: Record<string, string> = {
  line: 'what a projector shows: one straight stripe',
  curve: 'what a camera sees of a line: a chain of points, finer than pixels',
  crossing: 'a place where two curves meet in the image',
  'local ID': "the place of a line's colour in the repeating code of its pattern",
  label: 'of a curve: its projector, pattern and line',
  'measured surface': 'the surface without what nobody measured',
  'closed surface': 'with what closes it where nobody measured',
  'light plane': 'the plane of light behind a line, from its projector',
};

function group(title: string, entries: [string, string | undefined][]): Node[] {
  return [h('h3', {}, title), h('dl', {}, ...entries.flatMap(([word, about]) =>
    about ? [h('dt', {}, word), h('dd', {}, about)] : []))];
}

/** All of them, folded. */
export function wordList(): HTMLElement {
  const named = (list: {name: string; about?: string}[]) =>
    list.map(({name, about}): [string, string | undefined] => [name, about]);
  const figures: FigureText[] = Object.values(kFigures);
  return h('details', {class: 'raw words-list', id: 'words'}, h('summary', {}, 'What the words mean'),
    h('div', {class: 'grid'},
      h('div', {}, ...group('Words', Object.entries(kTerms))),
      h('div', {}, ...group('Why a place of the surface is not measured', named(kHoles))),
      h('div', {}, ...group('Why a curve has no label', named(kStates))),
      h('div', {}, ...group('Stages', Object.entries(kStageWords))),
      h('div', {}, ...group('Figures', figures.map(({name, hint}): [string, string | undefined] => [name, hint])))));
}
