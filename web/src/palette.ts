// Colours, the same as in the pictures that the program draws (src/pencilscan/report/palette.cpp).
export type Rgb = readonly [number, number, number]; // 0..255, sRGB

const kCategories: Rgb[] = [
  [72, 140, 255], [255, 159, 28], [46, 196, 182], [255, 77, 94],
  [178, 128, 255], [247, 231, 51], [110, 220, 100], [250, 250, 250],
];
export const kUndecided: Rgb = [128, 128, 128];

export function category(key: number): Rgb {
  return key < 0 ? kUndecided : kCategories[key % kCategories.length];
}

// Viridis (S. van der Walt, N. Smith; CC0) at nine places, between which it is nearly straight.
const kViridis: Rgb[] = [
  [68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141],
  [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37],
];

export function sequential(value: number): Rgb {
  if (!Number.isFinite(value)) return kUndecided;
  const at = Math.min(Math.max(value, 0), 1) * (kViridis.length - 1);
  const i = Math.min(Math.floor(at), kViridis.length - 2);
  const f = at - i;
  return [0, 1, 2].map((k) =>
    Math.round(kViridis[i][k] * (1 - f) + kViridis[i + 1][k] * f)) as unknown as Rgb;
}

/** From blue (-1) over a pale grey to red (1): what lies behind and before. */
export function diverging(value: number): Rgb {
  if (!Number.isFinite(value)) return kUndecided;
  const x = Math.min(Math.max(value, -1), 1);
  const [pale, end]: [Rgb, Rgb] = [[235, 235, 235], x < 0 ? [33, 102, 172] : [178, 24, 43]];
  return [0, 1, 2].map((k) => Math.round(pale[k] + Math.abs(x) * (end[k] - pale[k]))) as unknown as Rgb;
}

export const css = ([r, g, b]: Rgb, alpha = 1): string => `rgba(${r},${g},${b},${alpha})`;

export interface Named {
  name: string;
  color: Rgb;
  about?: string; // what the name means
}

/** Indices are those of `hole` in mesh.ply (docs/formats.md). */
export const kHoles: Named[] = [
  {name: 'background', color: [24, 24, 28]},
  {name: 'measured', about: 'some camera and projector fixed its depth', color: [225, 225, 225]},
  {name: 'no projector', about: 'in shadow of all projectors, turned away from them, or without their light in a picture', color: [70, 70, 160]},
  {name: 'one projector', about: 'lit by one projector only, whose lines did not fix the depth', color: [60, 160, 230]},
  {name: 'too compressed', about: 'lines lie closer together than the camera resolves, or the view is grazing', color: [240, 180, 40]},
  {name: 'ambiguous', about: 'several projectors light it, and yet no depth was accepted', color: [170, 80, 200]},
  {name: 'contradicted', about: 'a depth was found, and other views prove it wrong', color: [220, 50, 50]},
  {name: 'saturated', about: 'too bright for the camera there', color: [255, 255, 90]},
  {name: 'not seen', about: 'not seen by any camera', color: [90, 90, 90]},
];

/** Indices are those of `state` in curves.ply. */
export const kStates: Named[] = [
  {name: 'labelled', about: 'projector, pattern and line are known', color: [90, 110, 130]},
  {name: 'no crossing', about: 'nothing crosses the curve, and its surroundings do not decide', color: [247, 231, 51]},
  {name: 'ambiguous', about: 'several lines fit the curve', color: [200, 110, 240]},
  {name: 'contradicted', about: 'no line fits the crossings of the curve', color: [255, 70, 70]},
  {name: 'outside volume', about: 'no line meets the rays of the curve within the volume', color: [60, 170, 255]},
  {name: 'undecided', about: 'no line was decided on', color: [255, 159, 28]},
];

const kLightColors: Record<string, Rgb> = {
  blue: [70, 110, 255], cyan: [40, 215, 225], red: [255, 70, 60], yellow: [250, 215, 40],
  green: [60, 200, 80], magenta: [235, 80, 220], white: [235, 235, 235],
};
export const lightColor = (name: string | undefined): Rgb =>
  (name && kLightColors[name]) || [200, 200, 200];
