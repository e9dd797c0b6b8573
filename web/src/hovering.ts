// What the colours say of the place under the pointer.
import type {App} from './app';
import {kColorModes, isScaled, type ColorMode} from './coloring';
import type {Mesh} from './data';
import {h} from './dom';
import {extentOf, figureText, placeText, type FigureName} from './figure_text';
import {kHoles} from './palette';
import type {Picture3d} from './scene';

export interface Hovered {
  mode: ColorMode;
  mesh: Mesh | null; // in the picture
  points: boolean; // in the picture
}

export class Hovering {
  readonly element = h('div', {class: 'hover', hidden: true});
  private at: {x: number; y: number} | null = null;
  private pending = false;

  constructor(private readonly app: App, private readonly picture: Picture3d, private readonly ask: () => Hovered) {
    const {canvas} = picture;
    canvas.addEventListener('pointermove', (event) => {
      this.at = event.buttons === 0 && event.pointerType !== 'touch' ? {x: event.offsetX, y: event.offsetY} : null;
      this.later();
    });
    for (const leaving of ['pointerleave', 'pointerdown', 'wheel'] as const) {
      canvas.addEventListener(leaving, () => this.hide(), {passive: true});
    }
  }

  hide(): void {
    this.at = null;
    this.element.hidden = true;
  }

  /** Once a picture: a search in a large mesh takes its time. */
  private later(): void {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      this.draw();
    });
  }

  private draw(): void {
    const text = this.at && this.textAt(this.at.x, this.at.y);
    this.element.hidden = !text;
    if (!this.at || !text) return;
    const {clientWidth: width} = this.picture.canvas;
    this.element.replaceChildren(...text.map((line, k) => h(k === 0 ? 'strong' : 'span', {}, line)));
    const left = this.at.x > 0.6 * width;
    this.element.style.left = left ? '' : `${this.at.x + 14}px`;
    this.element.style.right = left ? `${width - this.at.x + 14}px` : '';
    this.element.style.top = `${this.at.y + 10}px`;
  }

  private textAt(x: number, y: number): string[] | null {
    const {app, picture} = this;
    const {mode, mesh, points} = this.ask();
    const hit = picture.meshHit(x, y);
    if (hit && mesh) return [...this.ofVertex(mode, hit.beside ? null : mesh, hit.vertex), this.place(hit.point.toArray())];
    const point = points && app.points ? picture.pointHit(app.points.position, x, y, 6) : -1;
    return point < 0 ? null : [...this.ofPoint(mode, point), this.place(app.position(point))];
  }

  private place(xyz: number[]): string {
    const {rig} = this.app;
    return `${placeText(xyz, extentOf(rig))} ${rig?.unit ?? 'mm'}`;
  }

  private figure(mode: FigureName, value: number | undefined): string[] {
    return [`${kColorModes.find((m) => m.value === mode)?.text ?? mode}: ${figureText(mode, value, this.app.rig?.unit ?? 'mm')}`];
  }

  private ofVertex(mode: ColorMode, mesh: Mesh | null, vertex: number): string[] {
    if (!mesh) return [];
    if (mode === 'hole') return [kHoles[mesh.hole?.[vertex] ?? -1]?.name ?? '–'];
    if (mode === 'confidence') return this.figure(mode, mesh.confidence && mesh.confidence[vertex] / 255);
    return isScaled(mode) ? this.figure(mode, mesh[mode]?.[vertex]) : [];
  }

  private ofPoint(mode: ColorMode, point: number): string[] {
    const {points, rig} = this.app;
    if (!points) return [];
    if (mode === 'camera') return [rig?.cameras[points.camera[point]]?.name ?? ''];
    if (mode === 'projector') return [rig?.projectors[points.projector[point]]?.name ?? ''];
    if (mode === 'line') return [`Line ${points.line[point]}`];
    if (mode === 'confidence') return this.figure(mode, points.confidence[point] / 255);
    if (mode === 'sigma' || mode === 'distance') return this.figure(mode, points[mode]?.[point]);
    return [];
  }
}
