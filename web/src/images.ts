// The image panel: one camera's picture with layers, zoom, and a click that selects.
import type {App} from './app';
import {byId, choice, h} from './dom';
import {crossingsPath, depthLegend, depthPicture, kLayers, layerLegend, layerPaths, type ColoredPath, type Layer} from './image_layers';
import {ImageView} from './image_view';
import {css, kHoles, type Named} from './palette';

type Base = 'picture' | 'holes' | 'depth';

const kBaseWords: Record<Base, string> = {picture: 'picture', holes: 'hole map', depth: 'depth'};
const partOf = (base: Base, camera: number): string =>
  `${base === 'picture' ? 'image' : base}/${camera}`;

export class Images {
  private camera = 0;
  private base: Base = 'picture';
  private layer: Layer = 'projector';
  private bitmap: CanvasImageSource | null = null;
  private paths: ColoredPath[] = [];
  private crossings: Path2D | null = null;
  private pending = false;
  private strip: HTMLButtonElement[] = [];
  private readonly canvas = h('canvas', {tabindex: 0, role: 'application'});
  private readonly view: ImageView;
  private readonly legend = h('div', {class: 'legend below', hidden: true});
  private readonly message = h('p', {class: 'overlay-message', hidden: true});
  private readonly cameraStrip = h('div', {class: 'camera-strip', role: 'group', 'aria-label': 'Cameras'});
  private readonly layerSelect = h('select', {id: 'layer', onchange: () => {
    this.layer = this.layerSelect.value as Layer;
    this.prepare();
  }}, ...kLayers.map(({value, text}) => h('option', {value}, text)));
  private readonly showCrossings = h('input', {type: 'checkbox', id: 'show-crossings',
    onchange: () => this.draw()});
  private readonly baseChoice = choice<Base>('Ground', [
    {value: 'picture', text: 'Picture'},
    {value: 'holes', text: 'Holes', title: 'Why there is no depth'},
    {value: 'depth', text: 'Depth'},
  ], 'picture', (value) => {
    this.base = value;
    void this.loadBase();
  });

  constructor(private readonly app: App) {
    this.layerSelect.value = this.layer;
    this.build();
    this.view = new ImageView(this.canvas, () => app.cameras[this.camera] ?? null,
      () => this.draw(), (x, y) => this.select(x, y));
    this.canvas.addEventListener('keydown', (event) => this.key(event));
    this.canvas.addEventListener('focus', () => this.draw());
    this.canvas.addEventListener('blur', () => this.draw());
    new ResizeObserver(() => this.resize()).observe(byId('canvas-image'));
    app.on('result', () => this.load());
    app.on('points', () => this.prepare());
    app.on('curves', () => this.prepare());
    app.on('selection', () => this.selectionChanged());
    app.on('theme', () => this.draw());
    // For tests and scripts: where a pixel is on the canvas.
    Object.assign(this.canvas, {pencilscanToCanvas: (u: number, v: number) => this.view.toCanvas(u, v)});
  }

  private build(): void {
    const button = (text: string, title: string, act: () => void) =>
      h('button', {type: 'button', title, 'aria-label': title, onclick: act}, text);
    byId('images').append(
      this.cameraStrip,
      h('div', {class: 'tools'},
        h('span', {class: 'tool-group'}, h('span', {class: 'tool-label'}, 'Ground'), this.baseChoice.element),
        h('label', {class: 'tool-group'}, h('span', {class: 'tool-label'}, 'Curves'), this.layerSelect),
        h('label', {class: 'check'}, this.showCrossings, 'Crossings'),
        h('span', {class: 'spacer'}),
        h('span', {class: 'tool-group'},
          button('−', 'Zoom out', () => this.view.zoomMiddle(1 / 1.5)),
          button('+', 'Zoom in', () => this.view.zoomMiddle(1.5)),
          button('Fit', 'Fit the whole image', () => this.view.fit()))),
      h('div', {class: 'canvas-holder', id: 'canvas-image'}, this.canvas, this.message), this.legend);
    this.canvas.setAttribute('aria-label', 'Camera image. Arrow keys move, plus and minus zoom, ' +
      '0 fits, Enter selects what is in the middle, brackets step along the selected line.');
  }

  private load(): void {
    const {app} = this;
    if (this.camera >= app.cameras.length) this.camera = 0;
    if (app.source.index.results[app.result] && !this.hasAnything(this.camera)) {
      const other = app.cameras.findIndex((_, c) => this.hasAnything(c));
      if (other >= 0) this.camera = other;
    }
    // Without devices nothing can be drawn here: the 3-D picture gets the room.
    byId('stage').classList.toggle('one-panel', app.rig === null);
    byId('panel-tabs').classList.toggle('one-panel', app.rig === null);
    const pictures = app.cameras.some((_, c) => app.source.has(app.result, `image/${c}`));
    this.strip = app.cameras.map((camera, c) => {
      const thumb = pictures
        ? h('canvas', {width: 96, height: 72, 'aria-hidden': 'true'}) : null;
      return h('button', {type: 'button', title: camera.name, onclick: () => this.showCamera(c)},
        thumb, h('span', {}, camera.name), h('i', {class: 'seen', 'aria-hidden': 'true'}));
    });
    this.cameraStrip.replaceChildren(...this.strip);
    this.markStrip();
    this.view.fit();
    this.prepare();
    void this.loadBase();
    void this.fillThumbs();
  }

  private hasAnything(camera: number): boolean {
    const {source, result} = this.app;
    return ['image', 'holes', 'depth'].some((part) => source.has(result, `${part}/${camera}`));
  }

  /** After the large picture, one small one after another. */
  private async fillThumbs(): Promise<void> {
    const {app, strip} = this;
    const {result} = app;
    await new Promise((done) => setTimeout(done, 300));
    for (let c = 0; c < strip.length; ++c) {
      if (app.result !== result || !app.source.has(result, `image/${c}`)) continue;
      const image = await app.source.image(result, `image/${c}`).catch(() => null);
      const canvas = strip[c].querySelector('canvas')!;
      if (!image) continue;
      const scale = Math.min(canvas.width / image.width, canvas.height / image.height);
      const [w, hgt] = [image.width * scale, image.height * scale];
      canvas.getContext('2d')!.drawImage(image, (canvas.width - w) / 2, (canvas.height - hgt) / 2, w, hgt);
    }
  }

  private showCamera(camera: number): void {
    if (camera === this.camera) return;
    this.camera = camera;
    this.markStrip();
    if (this.view.fitted) this.view.fit();
    this.prepare();
    void this.loadBase();
  }

  private markStrip(): void {
    const {app} = this;
    const {selection} = app;
    this.strip.forEach((button, c) => {
      button.setAttribute('aria-pressed', String(c === this.camera));
      const at = selection && selection.point >= 0 ? app.sees(c, ...app.position(selection.point)) : null;
      const state = selection?.camera === c ? 'source' :
        at === null ? '' : at.visible === false ? 'hidden' : 'visible';
      button.dataset.seen = state;
      button.title = `${app.cameras[c].name}${
        {source: ': measured the selected point', visible: ': sees the selected point',
          hidden: ': the selected point is hidden from it', '': ''}[state]}`;
    });
  }

  private async loadBase(): Promise<void> {
    const {app, camera, base} = this;
    const {result} = app;
    this.bitmap = null;
    let bitmap: CanvasImageSource | null = null;
    let reason = this.whyNoBase();
    if (!reason) {
      try {
        bitmap = base === 'depth' ? depthPicture(await app.source.depth(result, camera))
          : await app.source.image(result, partOf(base, camera));
      } catch (error) {
        reason = `It cannot be shown: ${String(error)}`;
      }
    }
    if (app.result !== result || this.camera !== camera || this.base !== base) return;
    this.bitmap = bitmap;
    this.message.textContent = reason;
    this.message.hidden = reason === '';
    this.drawLegend();
    this.draw();
  }

  /** Empty when the picture is there. */
  private whyNoBase(): string {
    const {app, camera, base} = this;
    if (!app.rig) return 'The devices are not known: no camera images can be shown.';
    if (app.source.has(app.result, partOf(base, camera))) return '';
    if (app.source.index.results[app.result]?.detail === 'shape') {
      return 'This frame has its shape only. Frames with a dot have images, too; pencilscan view has all.';
    }
    return `This result holds no ${kBaseWords[base]} of ${app.cameras[camera]?.name ?? 'this camera'}.`;
  }

  private prepare(): void {
    this.paths = layerPaths(this.app, this.camera, this.layer);
    this.crossings = crossingsPath(this.app.curves, this.camera);
    this.drawLegend();
    this.draw();
  }

  private drawLegend(): void {
    const children: HTMLElement[] = [];
    const keys = (title: string, named: Named[]) => {
      children.push(h('strong', {}, title), ...named.map(({name, color, about}) =>
        h('span', {class: 'key', title: about}, h('i', {style: `background:${css(color)}`}), name)));
    };
    const curves = this.paths.length ? layerLegend(this.app, this.layer) : null;
    if (curves) keys(curves.title, curves.named);
    if (this.base === 'holes' && this.bitmap) keys('Ground', kHoles.slice(0, 8));
    if (this.base === 'depth' && this.bitmap instanceof HTMLCanvasElement) {
      children.push(...depthLegend(this.bitmap, this.app.rig?.unit ?? 'mm'));
    }
    this.legend.replaceChildren(...children);
    this.legend.hidden = children.length === 0;
  }

  private resize(): void {
    const {width, height} = this.view.size();
    const ratio = Math.min(devicePixelRatio, 2);
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    if (this.view.fitted) this.view.fit();
    this.paint(); // at once: the canvas is empty now
  }

  private draw(): void {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      this.paint();
    });
  }

  private paint(): void {
    const context = this.canvas.getContext('2d')!;
    const device = this.app.cameras[this.camera];
    const {scale, left, top} = this.view;
    const ratio = this.canvas.width / this.view.size().width;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    if (!device) return;
    const s = scale * ratio;
    // Pixel centres sit at integer coordinates.
    context.setTransform(s, 0, 0, s, left * ratio + 0.5 * s, top * ratio + 0.5 * s);
    context.imageSmoothingEnabled = scale < 3 && this.base === 'picture';
    context.fillStyle = '#0b0d10';
    context.fillRect(-0.5, -0.5, device.width, device.height);
    if (this.bitmap) {
      context.globalAlpha = this.paths.length && this.base === 'picture' ? 0.55 : 1;
      context.drawImage(this.bitmap, -0.5, -0.5, device.width, device.height);
      context.globalAlpha = 1;
    }
    context.lineWidth = Math.max(0.8, Math.min(2.5, scale)) / scale;
    context.lineCap = 'round';
    const dots = !this.app.curves;
    for (const {color, path} of this.paths) {
      context.strokeStyle = context.fillStyle = css(color, scale > 8 ? 0.75 : 1);
      if (dots) context.fill(path);
      else context.stroke(path);
    }
    if (this.showCrossings.checked && this.crossings) {
      context.fillStyle = '#ffffffcc';
      context.fill(this.crossings);
    }
    this.paintSelection(context);
    if (this.canvas.matches(':focus-visible')) this.paintMiddle(context, ratio);
  }

  /** Who moves by keys sees what Enter would select. */
  private paintMiddle(context: CanvasRenderingContext2D, ratio: number): void {
    const {width, height} = this.view.size();
    context.setTransform(ratio, 0, 0, ratio, (width / 2) * ratio, (height / 2) * ratio);
    for (const [lineWidth, color] of [[3, '#000a'], [1.2, '#fff']] as const) {
      context.lineWidth = lineWidth;
      context.strokeStyle = color;
      context.beginPath();
      for (const [x, y] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
        context.moveTo(5 * x, 5 * y);
        context.lineTo(14 * x, 14 * y);
      }
      context.stroke();
    }
  }

  private paintSelection(context: CanvasRenderingContext2D): void {
    const {app} = this;
    const {selection} = app;
    const {scale} = this.view;
    if (!selection) return;
    let at: {u: number; v: number} | null = null;
    let hidden = false;
    if (selection.camera === this.camera) at = selection;
    else if (selection.point >= 0) {
      const seen = app.sees(this.camera, ...app.position(selection.point));
      at = seen;
      hidden = seen?.visible === false;
    }
    if (!at) return;
    const r = 9 / scale;
    context.setLineDash(hidden ? [3 / scale, 3 / scale] : []);
    for (const [width, color] of [[5, '#000a'], [2.5, '#ff3d6e']] as const) {
      context.lineWidth = width / scale;
      context.strokeStyle = color;
      context.beginPath();
      context.arc(at.u, at.v, r, 0, 7);
      for (const [du, dv] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
        context.moveTo(at.u + du * r, at.v + dv * r);
        context.lineTo(at.u + du * r * 1.8, at.v + dv * r * 1.8);
      }
      context.stroke();
    }
    context.setLineDash([]);
  }

  private selectionChanged(): void {
    const {selection} = this.app;
    if (selection) {
      this.showCamera(selection.camera);
      if (!this.view.fitted) this.view.reveal(selection.u, selection.v);
    }
    this.markStrip();
    this.draw();
  }

  /** near: of what a click may miss, CSS pixels. */
  private select(x: number, y: number, near = 9): void {
    const {u, v} = this.view.toImage(x, y);
    const reach = Math.max(1.5, near / this.view.scale);
    if (!this.app.pick(this.camera, u, v, reach)) this.app.clearSelection();
  }

  private key(event: KeyboardEvent): void {
    const {view} = this;
    const {width, height} = view.size();
    const step = 40;
    const acts: Record<string, () => void> = {
      ArrowLeft: () => view.pan(step, 0), ArrowRight: () => view.pan(-step, 0),
      ArrowUp: () => view.pan(0, step), ArrowDown: () => view.pan(0, -step),
      '+': () => view.zoomMiddle(1.3), '=': () => view.zoomMiddle(1.3),
      '-': () => view.zoomMiddle(1 / 1.3), '0': () => view.fit(),
      Enter: () => this.select(width / 2, height / 2, 30),
      '[': () => this.app.step(-1), ']': () => this.app.step(1),
      Escape: () => this.app.clearSelection(),
    };
    if (!acts[event.key]) return;
    event.preventDefault();
    acts[event.key]();
  }
}
