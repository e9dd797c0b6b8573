// The 3-D panel: picture, tools, legend, selection in space, measuring.
import {Group, Vector3} from 'three';
import type {App} from './app';
import {
  colorMesh, colorPoints, fittedRange, isScaled, kColorModes, legendOf, type ColorMode,
} from './coloring';
import type {Mesh, RigJson} from './data';
import {clear, drawDevices} from './devices3d';
import {Device, type Vec3} from './device';
import {byId, choice, h} from './dom';
import {extentOf} from './figure_text';
import {Hovering} from './hovering';
import {LegendPanel} from './legend_panel';
import {Measuring, type Measure} from './measuring';
import type {Rgb} from './palette';
import {ReferenceView} from './reference_view';
import {Picture3d} from './scene';
import {drawSelection} from './selection3d';
import {boxOf, SpaceAids} from './space_aids';

type Surface = 'mesh' | 'measured' | 'none';
type Tool = 'select' | Measure;

const cssColor = (name: string): string =>
  getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function rgbOf(name: string): Rgb {
  const hex = cssColor(name);
  return [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16)) as unknown as Rgb;
}

export class Viewer {
  private picture: Picture3d | null = null;
  private surface: Surface = 'mesh'; // in the picture
  private wanted = {surface: 'mesh' as Surface, points: false}; // whatever a result has
  private mode: ColorMode = 'shading';
  private tool: Tool = 'select';
  private meshes: Record<'mesh' | 'measured', Mesh | null> = {mesh: null, measured: null};
  private readonly devices = new Group();
  private readonly picked = new Group();
  private playing: Mesh | null = null; // while a sequence plays or is scrubbed: what is in the picture
  private readonly reference: ReferenceView;
  private shown = -1; // result in the picture
  private readonly colorSelect = h('select', {id: 'color-mode', onchange: () => {
    this.mode = this.colorSelect.value as ColorMode;
    this.modeChosen();
  }});
  private readonly viewSelect = h('select', {id: 'view-from', onchange: () => this.lookFrom()});
  private readonly showPoints = h('input', {type: 'checkbox', id: 'show-points',
    onchange: () => {
      this.wanted.points = this.showPoints.checked;
      this.drawPoints();
    }});
  private readonly showDevices = h('input', {type: 'checkbox', id: 'show-devices', checked: true,
    onchange: () => this.drawDevices()});
  private readonly aids = new SpaceAids(h('label', {class: 'check'}, this.showDevices, 'Devices'));
  private readonly showSheet = h('input', {type: 'checkbox', id: 'show-sheet', checked: true,
    onchange: () => this.drawSelection()});
  private readonly sheetLabel = h('label', {class: 'check', hidden: true, title:
    'The light of the selected line, as a plane from its projector'}, this.showSheet, 'Light plane');
  private readonly legend = new LegendPanel(() => this.recolor());
  private readonly message = h('p', {class: 'overlay-message', hidden: true});
  private readonly measuring = new Measuring(() => ({
    position: this.app.points?.position ?? this.currentMesh()?.position ?? null,
    radius: this.picture?.bounds.radius ?? 100,
    extent: extentOf(this.app.rig) || (this.picture?.bounds.radius ?? 0),
    eye: (this.picture?.camera.position.toArray() ?? [0, 0, 0]) as Vec3,
    unit: this.app.rig?.unit ?? 'mm',
  }), () => this.picture?.render());
  private readonly surfaceChoice = choice<Surface>('Surface', [
    {value: 'mesh', text: 'Closed', title: 'mesh.ply: the closed surface'},
    {value: 'measured', text: 'Measured', title: 'mesh_measured.ply: only what was measured'},
    {value: 'none', text: 'None'},
  ], 'mesh', (value) => {
    this.wanted.surface = this.surface = value;
    void this.drawSurface();
  });
  private readonly toolChoice = choice<Tool>('Tool', [
    {value: 'select', text: 'Select', title: 'Click the shape: which measurement is it?'},
    {value: 'distance', text: 'Distance', title: 'Click two places'},
    {value: 'angle', text: 'Angle', title: 'Click two flat places: planes are fitted to the points'},
  ], 'select', (value) => {
    this.tool = value;
    this.measuring.start(value === 'select' ? null : value);
  });

  constructor(private readonly app: App) {
    this.reference = new ReferenceView(app);
    this.build();
    app.on('result', () => void this.load());
    app.on('points', () => this.pointsArrived());
    app.on('selection', () => this.drawSelection());
    app.on('reference', () => void this.referenceChosen());
    app.on('theme', () => {
      this.recolor();
      this.drawDevices(); // their ink
    });
  }

  private build(): void {
    const panel = byId('viewer');
    const check = (input: HTMLInputElement, text: string) =>
      h('label', {class: 'check'}, input, text);
    panel.append(
      h('div', {class: 'tools'},
        h('span', {class: 'tool-group'}, h('span', {class: 'tool-label'}, 'Surface'),
          this.surfaceChoice.element),
        check(this.showPoints, 'Points'),
        h('label', {class: 'tool-group'}, h('span', {class: 'tool-label'}, 'Colour'), this.colorSelect),
        h('label', {class: 'tool-group'}, h('span', {class: 'tool-label'}, 'View'), this.viewSelect),
        this.aids.menu,
        h('button', {type: 'button', title: 'Save a screenshot of the 3-D picture', 'aria-label': 'Save a screenshot', onclick: () => void this.save()},
          'PNG')),
      h('div', {class: 'canvas-holder', id: 'canvas-3d'}, this.message, this.legend.element, ...this.reference.halves, this.aids.overlay,
        this.measuring.readout,
        h('div', {class: 'canvas-tools'}, this.toolChoice.element, this.measuring.patchLabel, this.sheetLabel)));
    try {
      this.picture = new Picture3d(byId('canvas-3d'));
    } catch (error) {
      this.say(`The 3-D picture needs WebGL, which this browser does not offer (${String(error)}).`);
      return;
    }
    const {canvas, helpers} = this.picture;
    canvas.setAttribute('role', 'application');
    canvas.setAttribute('aria-label',
      '3-D view. Arrow keys turn it, plus and minus zoom, 0 shows everything.');
    helpers.add(this.devices, this.picked, this.measuring.group);
    this.aids.attach(this.picture);
    const hovering = new Hovering(this.app, this.picture, () =>
      ({mode: this.mode, mesh: this.currentMesh(), points: this.pointsShown}));
    byId('canvas-3d').append(hovering.element);
    let down: {x: number; y: number} | null = null;
    canvas.addEventListener('pointerdown', (e) => (down = {x: e.offsetX, y: e.offsetY}));
    canvas.addEventListener('pointerup', (e) => {
      if (down && Math.hypot(e.offsetX - down.x, e.offsetY - down.y) < 5) {
        this.click(e.offsetX, e.offsetY);
      }
      down = null;
    });
    // For tests and scripts: where a world point is on the canvas.
    Object.assign(canvas, {pencilscanProject: (p: Vec3) =>
      this.picture!.toCanvas(new Vector3(...p))});
  }

  private say(text: string): void {
    this.message.textContent = text;
    this.message.hidden = text === '';
  }

  private async load(): Promise<void> {
    const {app} = this;
    this.meshes = {mesh: null, measured: null};
    this.playing = null;
    this.fillSelects();
    this.drawPoints();
    this.drawDevices();
    this.measuring.reset();
    const has = (part: string) => app.source.has(app.result, part);
    const {surface} = this.wanted;
    const other = has('measured') ? 'measured' : 'none';
    this.surface = surface === 'none' || has('mesh') ? surface : other;
    this.showPoints.checked = this.wanted.points || (this.surface === 'none' && has('points'));
    this.surfaceChoice.set(this.surface);
    this.say(has('mesh') || has('measured') || has('points') ? '' : 'This result holds no shape.');
    await this.drawSurface();
  }

  private fillSelects(): void {
    const {rig} = this.app;
    const chosen = this.viewSelect.value;
    const group = (name: string, devices: {name: string}[], prefix: string) =>
      h('optgroup', {label: name},
        ...devices.map((d, i) => h('option', {value: `${prefix}${i}`}, d.name)));
    this.viewSelect.replaceChildren(
      h('option', {value: 'free'}, 'Free'),
      ...['Front', 'Right', 'Back', 'Left', 'Above', 'Below'].map((name) =>
        h('option', {value: name}, name)),
      ...(rig ? [h('option', {value: 'rig'}, 'Devices')] : []), ...(rig ? [group('Cameras', rig.cameras, 'c'), group('Projectors', rig.projectors, 'p')] : []));
    if ([...this.viewSelect.options].some((o) => o.value === chosen)) this.viewSelect.value = chosen;
    this.fillColorModes();
  }

  private fillColorModes(): void {
    const mesh = this.currentMesh() ?? this.meshes.mesh;
    const {points} = this.app;
    const available: Record<ColorMode, boolean> = {
      shading: true, albedo: mesh?.color !== undefined, camera: points !== null,
      projector: points !== null, line: points !== null && points.count > 0 && this.app.patternOf(0) !== undefined,
      sigma: points !== null || mesh?.sigma !== undefined,
      confidence: points !== null || mesh?.confidence !== undefined,
      hole: mesh?.hole !== undefined,
      distance: points?.distance !== undefined || mesh?.distance !== undefined,
      difference: this.reference.mesh !== null,
    };
    this.colorSelect.replaceChildren(...kColorModes.map(({value, text}) =>
      h('option', {value, disabled: !available[value]}, text)));
    if (!available[this.mode] && this.mode === 'difference') this.mode = 'shading';
    if (available[this.mode]) this.colorSelect.value = this.mode;
  }

  private currentMesh(): Mesh | null {
    return this.playing ?? (this.surface === 'none' ? null : this.meshes[this.surface]);
  }

  private async drawSurface(): Promise<void> {
    const {app, picture} = this;
    if (!picture) return;
    const part = this.surface;
    const {result} = app;
    let fault = `There is no ${part === 'mesh' ? 'closed' : 'measured'} surface in this result.`;
    if (part !== 'none' && !this.meshes[part] && app.source.has(result, part)) {
      const mesh = await app.source.mesh(result, part).catch((error: unknown) => {
        fault = `The surface cannot be shown: ${String(error)}`;
        return null;
      });
      if (app.result !== result) return;
      this.meshes[part] = mesh;
      if (this.surface !== part) return;
    }
    const mesh = this.currentMesh();
    picture.setMesh(mesh);
    if (mesh && this.shown !== result) this.frame(mesh.position);
    if (mesh || part !== 'none') this.say(mesh ? '' : fault);
    this.fillColorModes();
    this.recolor();
  }

  /** Shows another result's shape from where the last one was seen; the first one from the front. */
  private frame(position: Float32Array): void {
    const {picture} = this;
    if (!picture || position.length === 0) return;
    const {low, high} = boxOf(position);
    const center = low.map((x, k) => (x + high[k]) / 2) as Vec3;
    picture.setBounds(center, Math.max(1e-6, Math.hypot(...low.map((x, k) => high[k] - x)) / 2));
    if (this.shown < 0) this.lookFrom();
    this.shown = this.app.result;
  }

  private lookFrom(): void {
    const {picture, app} = this;
    const value = this.viewSelect.value;
    const sides: Record<string, Vec3> = {Front: [1, 0, 0.15], Right: [0, 1, 0.15], Back: [-1, 0, 0.15],
      Left: [0, -1, 0.15], Above: [0.01, 0, 1], Below: [0.01, 0, -1]};
    if (!picture) return;
    if (value === 'free' || sides[value]) {
      picture.fit(sides[value]);
    } else if (value === 'rig' && app.rig) {
      this.showRig(app.rig, picture);
    } else if (app.rig) {
      const list = value[0] === 'c' ? app.rig.cameras : app.rig.projectors;
      picture.viewFrom(new Device(list[Number(value.slice(1))]));
    }
  }

  /** From so far that the devices are in sight. */
  private showRig(rig: RigJson, picture: Picture3d): void {
    const {center, radius} = picture.bounds;
    const away = [...rig.cameras, ...rig.projectors].map((d) => new Vector3(...new Device(d).center).distanceTo(center));
    if (!this.showDevices.checked) {
      this.showDevices.checked = true;
      this.drawDevices();
    }
    picture.fit(undefined, Math.max(1, (0.8 * Math.max(...away)) / radius));
  }

  private pointsArrived(): void {
    this.fillColorModes();
    this.drawPoints();
    if (this.shown !== this.app.result && this.app.points) this.frame(this.app.points.position);
  }

  /** Reasons of holes are those of the surface: points, which have none, would cover them. */
  private get pointsShown(): boolean {
    return this.showPoints.checked && this.app.points !== null && !this.playing &&
      !(this.mode === 'hole' && this.currentMesh() !== null);
  }

  private drawPoints(): void {
    const {picture, app} = this;
    if (!picture) return;
    picture.setPoints(this.pointsShown ? app.points!.position : null);
    this.recolor();
  }

  private drawDevices(): void {
    const {picture, app} = this;
    clear(this.devices);
    if (picture && app.rig && this.showDevices.checked) {
      this.devices.add(drawDevices(app.rig, cssColor('--ink-3d')));
    }
    picture?.render();
  }

  /** Some colours only points have: show them then. */
  private modeChosen(): void {
    const mesh = this.currentMesh();
    const ofPoints = ['camera', 'projector', 'line'].includes(this.mode) ||
      (this.mode === 'sigma' && !mesh?.sigma) || (this.mode === 'confidence' && !mesh?.confidence) ||
      (this.mode === 'distance' && !mesh?.distance);
    if (ofPoints) this.wanted.points = this.showPoints.checked = true;
    if (this.mode === 'hole' && this.surface !== 'mesh') {
      this.wanted.surface = this.surface = 'mesh';
      this.surfaceChoice.set('mesh');
      void this.drawSurface();
    }
    this.drawPoints();
  }

  private recolor(): void {
    const {picture, app} = this;
    if (!picture) return;
    const mesh = this.currentMesh();
    const {points} = app;
    const [clay, invented] = [rgbOf('--clay'), rgbOf('--invented')];
    const closed = mesh ?? this.meshes.mesh;
    if (mesh) this.reference.compare(mesh);
    this.aids.show(mesh?.position ?? (this.pointsShown ? points!.position : null), app.rig?.unit ?? 'mm');
    if (isScaled(this.mode)) this.legend.fit(this.mode, fittedRange(this.mode, points, closed));
    const {ranges} = this.legend;
    picture.setBackground(cssColor('--canvas'));
    picture.pointSize = 2 * Math.min(devicePixelRatio, 2);
    if (mesh) picture.setColors('mesh', colorMesh(mesh, this.mode, ranges, clay, invented));
    this.reference.draw(picture, (other) => colorMesh(other, this.mode, ranges, clay, invented));
    if (points && this.pointsShown) {
      picture.setColors('points',
        colorPoints(points, closed, this.mode, app.rig, ranges, rgbOf('--point')));
    }
    this.legend.show(legendOf(this.mode, app.rig, mesh, clay, invented));
  }

  private click(x: number, y: number): void {
    const {picture, app} = this;
    if (!picture) return;
    const hit = picture.meshHit(x, y)?.point;
    const {points} = app;
    if (this.tool !== 'select') {
      const i = !hit && points ? picture.pointHit(points.position, x, y, 12) : -1;
      const at = hit ? (hit.toArray() as Vec3) : i >= 0 ? app.position(i) : null;
      if (at) this.measuring.add(at);
      return;
    }
    if (!points) return;
    const chosen = hit ? this.nearestTo(points.position, hit) :
      picture.pointHit(points.position, x, y, 12);
    if (chosen >= 0) app.selectPoint(chosen);
    else app.clearSelection();
  }

  private nearestTo(position: Float32Array, hit: Vector3): number {
    let best = -1;
    let least = (0.05 * this.picture!.bounds.radius) ** 2;
    for (let i = 0; i < position.length / 3; ++i) {
      const d = (position[3 * i] - hit.x) ** 2 + (position[3 * i + 1] - hit.y) ** 2 +
        (position[3 * i + 2] - hit.z) ** 2;
      if (d < least) {
        least = d;
        best = i;
      }
    }
    return best;
  }

  private drawSelection(): void {
    const {picture, app} = this;
    if (!picture) return;
    clear(this.picked);
    const {selection} = app;
    this.sheetLabel.hidden = !selection || selection.point < 0 || !app.patternOf(selection.point);
    drawSelection(app, this.picked, this.showSheet.checked);
    picture.render();
  }

  /** One frame of a playing sequence, in the colours of the scale that is shown. */
  play(mesh: Mesh): void {
    const {picture} = this;
    if (!picture) return;
    const begins = !this.playing;
    this.playing = mesh;
    if (begins) { // what belongs to another frame
      picture.setPoints(null);
      clear(this.picked);
    }
    this.reference.compare(mesh);
    picture.setMesh(mesh, true);
    picture.setColors('mesh', colorMesh(mesh, this.mode, this.legend.ranges, rgbOf('--clay'), rgbOf('--invented')));
  }

  private async referenceChosen(): Promise<void> {
    if (!(await this.reference.read())) return;
    if (this.app.reference && !this.reference.mesh) this.say('The frame to compare with has no surface.');
    this.mode = this.reference.modeFor(this.mode);
    this.fillColorModes();
    this.drawPoints();
  }

  private async save(): Promise<void> {
    const blob = await this.picture?.screenshot();
    if (!blob) return;
    const link = h('a', {download: `${this.app.source.index.title}.png`, href: URL.createObjectURL(blob)});
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }
}
