// Measuring in space: the distance of two places, the angle of two fitted planes.
import {Group, Vector3} from 'three';
import {clear, drawMarker, drawSegments} from './devices3d';
import type {Vec3} from './device';
import {h} from './dom';
import {lengthText, significant} from './figure_text';
import {angleBetween, fitPlane, type Plane} from './plane_fit';

export type Measure = 'distance' | 'angle';

const kColor = 0xffd23f;

/** What measuring needs to know of the picture. */
export interface Measured {
  position: Float32Array | null; // places that planes are fitted to
  radius: number; // of the whole shape
  extent: number; // of the scene: how many decimals lengths have
  eye: Vec3;
  unit: string;
}

export class Measuring {
  readonly group = new Group();
  readonly readout = h('output', {class: 'readout', hidden: true, 'aria-live': 'polite'});
  readonly patchLabel: HTMLElement;
  private measure: Measure | null = null;
  private marks: {at: Vec3; plane: Plane | null}[] = [];
  private readonly patch = h('input', {type: 'range', id: 'patch', min: 1, max: 30, value: 8,
    'aria-label': 'Radius of the fitted patches, percent of the shape', oninput: () => this.refit()});

  constructor(private readonly ask: () => Measured, private readonly changed: () => void) {
    this.patchLabel = h('label', {class: 'check', hidden: true}, 'Patch', this.patch);
  }

  /** Begins anew; null: nothing is measured. */
  start(measure: Measure | null): void {
    this.measure = measure;
    this.reset();
  }

  reset(): void {
    this.marks = [];
    this.draw();
  }

  add(at: Vec3): void {
    if (this.marks.length === 2) this.marks = [];
    this.marks.push({at, plane: this.planeAt(at)});
    this.draw();
  }

  private get patchRadius(): number {
    return (Number(this.patch.value) / 100) * this.ask().radius;
  }

  private planeAt(at: Vec3): Plane | null {
    const {position} = this.ask();
    return this.measure === 'angle' && position ? fitPlane(position, at, this.patchRadius) : null;
  }

  private refit(): void {
    for (const mark of this.marks) mark.plane = this.planeAt(mark.at);
    this.draw();
  }

  private draw(): void {
    const {marks, group} = this;
    this.patchLabel.hidden = this.measure !== 'angle';
    this.readout.hidden = this.measure === null;
    clear(group);
    for (const {at, plane} of marks) {
      const marker = drawMarker('#ffd23f');
      marker.position.set(...at);
      group.add(marker);
      if (plane) group.add(this.disc(plane));
    }
    if (this.measure === 'distance') {
      if (marks.length === 2) group.add(drawSegments([...marks[0].at, ...marks[1].at], kColor));
      this.readout.textContent = this.distanceText();
    } else if (this.measure === 'angle') {
      this.readout.textContent = this.angleText();
    }
    this.changed();
  }

  private distanceText(): string {
    const {marks} = this;
    if (marks.length < 2) return marks.length ? 'Click the second place.' : 'Click two places on the shape.';
    const {extent, unit} = this.ask();
    const length = Math.hypot(...marks[0].at.map((x, k) => x - marks[1].at[k]));
    return `Distance ${lengthText(length, extent)} ${unit}`;
  }

  private angleText(): string {
    const {marks} = this;
    const {unit, eye} = this.ask();
    if (marks.some((m) => !m.plane)) return 'Too few points there: take a larger patch.';
    const fits = marks.map((m) => `${m.plane!.count} points, rms ${significant(m.plane!.rms)} ${unit}`);
    if (marks.length < 2) return marks.length ? `First plane: ${fits[0]}. Click the second one.` :
      'Click two flat places; planes are fitted to the points around them.';
    const angle = angleBetween(marks[0].plane!, marks[1].plane!, eye);
    return `Angle between the normals ${angle.toFixed(2)}° (${fits.join('; ')})`;
  }

  private disc(plane: Plane) {
    const n = new Vector3(...plane.normal);
    const a = new Vector3(Math.abs(n.x) < 0.9 ? 1 : 0, Math.abs(n.x) < 0.9 ? 0 : 1, 0).cross(n).normalize();
    const b = n.clone().cross(a);
    const center = new Vector3(...plane.center);
    const r = this.patchRadius;
    const rim = (i: number) => center.clone()
      .addScaledVector(a, r * Math.cos(i * Math.PI / 24)).addScaledVector(b, r * Math.sin(i * Math.PI / 24));
    const positions: number[] = [];
    for (let i = 0; i < 48; ++i) positions.push(...rim(i).toArray(), ...rim(i + 1).toArray());
    positions.push(...center.toArray(), ...center.clone().addScaledVector(n, 0.6 * r).toArray());
    return drawSegments(positions, kColor);
  }
}
