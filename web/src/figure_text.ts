// The name, the digits and the unit of every figure: the same wherever the page shows it.
import type {RigJson} from './data';
import {Device} from './device';
import {format, percent} from './dom';

export interface FigureText {
  name: string;
  text: (value: number, unit: string) => string; // unit: of lengths
  hint?: string;
}

/** Three significant digits, no fewer: neighbours in a table can be compared. */
export function significant(value: number): string {
  if (value === 0 || Math.abs(value) >= 1000) return format(Math.round(value));
  const text = value.toPrecision(3);
  return text.includes('e') ? format(value) : text;
}

const kSteps = 1e4; // of the last decimal within the extent, at least

/** As many decimals as the size of the scene deserves: 0.01 for 150. Three digits where it is not known (0). */
export function lengthText(value: number, extent: number): string {
  if (!Number.isFinite(value)) return '–';
  if (!(extent > 0 && Number.isFinite(extent))) return significant(value);
  const decimals = Math.ceil(Math.log10(kSteps / extent) - 1e-9);
  return value.toFixed(Math.min(Math.max(decimals, 0), 20));
}

/** The coordinates of a place; they are the scale themselves where the extent is not known. */
export function placeText(xyz: readonly number[], extent: number): string {
  const scale = extent > 0 ? extent : Math.max(...xyz.map(Math.abs));
  return xyz.map((x) => lengthText(x, scale)).join(', ');
}

/** Half the size of the scene: its volume's radius, or else the largest coordinate of a device; 0: not known. */
export function extentOf(rig: RigJson | null): number {
  const radius = rig?.volume?.radius ?? 0;
  if (radius > 0 || !rig) return radius;
  const places = [...rig.cameras, ...rig.projectors].flatMap((device) => new Device(device).center);
  return Math.max(0, ...places.map(Math.abs).filter(Number.isFinite));
}

const count = (value: number): string => format(Math.round(value));
const share = (value: number): string => percent(value);
const rare = (value: number): string => percent(value, 2); // shares that are small when all is well
const length = (value: number, unit: string): string => `${significant(value)} ${unit}`;
const pixels = (value: number): string => `${significant(value)} px`;
const seconds = (value: number): string => `${significant(value)} s`;

export const kFigures = {
  points: {name: 'Measured points', text: count},
  measured_share: {name: 'Surface measured', text: share, hint: 'share of the closed surface that was measured'},
  labelled_share: {name: 'Share labelled', text: share, hint: 'of the points on curves'},
  crossing_px: {name: 'Lines disagree by', text: pixels, hint: 'median at crossings'},
  crossing_expected_px: {name: 'Noise explains', text: pixels},
  line_width_px: {name: 'Sharpness: width of lines', text: pixels, hint: 'standard deviation of their profiles'},
  line_height: {name: 'Light of the lines', text: share, hint: 'above their surroundings, of full scale'},
  image_level: {name: 'Light of the picture', text: rare, hint: 'mean, of full scale'},
  saturated_pixels: {name: 'Saturated pixels', text: count},
  time_spread_us: {name: 'Spread of the moments', text: (x: number) => `${significant(x)} µs`},
  time_offset_us: {name: "From the frame's moment", text: (x: number) => `${significant(x)} µs`},
  warnings: {name: 'Warnings', text: count},
  sigma: {name: 'Sigma', text: length, hint: 'one standard deviation along the ray'},
  sigma_median: {name: 'Sigma, median', text: length, hint: 'one standard deviation along the ray'},
  sigma_px: {name: 'Sigma in the image', text: pixels},
  confidence: {name: 'Confidence', text: significant},
  distance: {name: 'Distance to truth', text: length},
  difference: {name: 'Difference', text: length, hint: 'along the normal of the frame compared with'},
  label_error: {name: 'Label error', text: rare, hint: 'points with a wrong line'},
  line_recall: {name: 'Line recall', text: share, hint: 'true lines that were measured, spacing from 5 px'},
  line_recall_3_5px: {name: 'Line recall, 3–5 px', text: share},
  distance_median_mm: {name: 'Distance, median', text: length, hint: 'points to the truth'},
  completeness_1mm: {name: 'Complete at 1 mm', text: share, hint: 'of the measurable surface'},
  total: {name: 'Time', text: seconds},
} satisfies Record<string, FigureText>;

export type FigureName = keyof typeof kFigures;

/** A figure in words; "–" where it is not known. */
export function figureText(name: FigureName, value: number | null | undefined, unit = 'mm'): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  return kFigures[name].text(value, unit);
}
