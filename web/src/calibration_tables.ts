// The lesser parts of a calibration: once round the ring, colour, what every pair shares, and how
// its images decoded. Reads calibration.json as docs/report.md describes it; each key may be absent.
import {table} from './charts';
import {dig, digList, digNumber, type Json} from './data';
import {format, h, percent} from './dom';

const textOf = (value: Json | undefined): string => (typeof value === 'string' ? value : '');
const numbersOf = (value: Json | undefined): number[] =>
  Array.isArray(value) ? value.filter((x): x is number => typeof x === 'number') : [];

/** Steps from device to neighbour, each by its own two devices alone: what they miss by at the end. */
function loopPart(report: Json, unit: string): HTMLElement | null {
  const loop = dig(report, 'loop');
  const devices = digList(loop, 'devices').map(textOf);
  if (!devices.length) return null;
  const gap = digNumber(loop, 'gap');
  const scale = digNumber(loop, 'scale');
  return h('p', {class: 'loop'}, h('strong', {}, 'Once round the ring '),
    `(${devices.join(', ')} and back to ${devices[0]}), each step by the correspondences of its own two devices alone: ` +
    `points of the volume come back ${format(gap, 2)} ${unit} off, ${format(digNumber(loop, 'gap_px'), 2)} px in ${devices[0]}; ` +
    `turned by ${format(digNumber(loop, 'rotation_deg'), 2)}°, lengths by ${percent(scale === undefined ? undefined : scale - 1, 2)}. ` +
    'The adjustment of the whole rig spreads such gaps evenly; a large one says that steps contradict each other.');
}

/** "0.31, -0.02 ± 0.01" */
function shift(estimate: Json | undefined): string {
  const [x, y] = numbersOf(dig(estimate, 'shift_px'));
  const sigma = Math.max(0, ...numbersOf(dig(estimate, 'shift_sigma_px')));
  return x === undefined || y === undefined ? '–' : `${format(x, 2)}, ${format(y, 2)} ± ${format(sigma, 1)}`;
}

function colorPart(report: Json): HTMLElement | null {
  const remarks = digList(report, 'color', 'remarks').map(textOf).filter(Boolean);
  const devices = digList(report, 'color', 'registration', 'devices');
  if (!remarks.length && !devices.length) return null;
  return h('section', {'aria-label': 'Colour'}, h('h3', {}, 'Colour'),
    remarks.length ? h('ul', {}, ...remarks.map((text) => h('li', {}, text))) : null,
    devices.length ? table(['Device', 'Red, px', 'Green, px', 'Blue, px'],
      devices.map((d) => [textOf(dig(d, 'name')), ...['red', 'green', 'blue'].map((color) => shift(dig(d, color)))]),
      'Where a device has each colour in the middle of its image, against all colours together (x, y and one standard deviation)') : null);
}

function pairTable(report: Json): HTMLElement | null {
  const pairs = digList(report, 'pairs').filter((pair) => digNumber(pair, 'inlier_share') !== undefined);
  if (!pairs.length) return null;
  return table(['Pair', 'Correspondences', 'Fit one geometry', 'Fit one plane'],
    pairs.map((pair) => [`${textOf(dig(pair, 'projector'))} / ${textOf(dig(pair, 'camera'))}`,
      format(digNumber(pair, 'correspondences')), percent(digNumber(pair, 'inlier_share')), percent(digNumber(pair, 'planar_share'))]),
    'Pairs of a projector and a camera');
}

function decodingTable(report: Json): HTMLElement | null {
  const entries = digList(report, 'decoding').filter((entry) => dig(entry, 'pixels') !== undefined);
  if (!entries.length) return null;
  // The good ones first; the file's own order is the alphabet's.
  const states = Object.keys((dig(entries[0], 'pixels') ?? {}) as object).sort((a, b) => Number(b === 'valid') - Number(a === 'valid'));
  return table(['Capture, pair', ...states, 'of lit', 'Correspondences'],
    entries.map((entry) => [`${format((digNumber(entry, 'capture') ?? 0) + 1)}, ${textOf(dig(entry, 'projector'))} / ${textOf(dig(entry, 'camera'))}`,
      ...states.map((state) => format(digNumber(entry, 'pixels', state))),
      percent(digNumber(entry, 'valid_share_of_lit')), format(digNumber(entry, 'correspondences'))]),
    'Decoding: pixels by what became of them');
}

/** All of it, as far as the file has it. */
export function lesserParts(report: Json, unit: string): HTMLElement[] {
  return [loopPart(report, unit), colorPart(report), pairTable(report), decodingTable(report)].filter((x) => x !== null);
}
