// The image panel: one camera's picture with layers, zoom, and a click that selects.
import type {App} from './app';
import type {Curves} from './data';
import {byId, choice, h} from './dom';
import {category, css, kHoles, kStates, kUndecided, lightColor, sequential, type Named, type Rgb} from './palette';

type Base = 'picture' | 'holes' | 'depth';
type Layer = 'local' | 'projector' | 'color' | 'confidence' | 'undecided' | 'none';

const kLayers: {value: Layer; text: string}[] = [
  {value: 'local', text: 'Local ID'},
  {value: 'projector', text: 'Projector'},
  {value: 'color', text: 'Code colour'},
  {value: 'confidence', text: 'Confidence'},
  {value: 'undecided', text: 'Undecided: why'},
  {value: 'none', text: 'No curves'},
];

const kConfidenceSteps = 8;

export class Images {
  private camera = 0;
  private base: Base = 'picture';
  private layer: Layer = 'projector';
  private scale = 1; // CSS pixels per image pixel
  private left = 0; // of the image's corner, CSS pixels
  private top = 0;
  private fitted = true;
  private bitmap: CanvasImageSource | null = null;
  private paths: {color: Rgb; path: Path2D}[] = [];
  private crossings: Path2D | null = null;
  private pending = false;
  private strip: HTMLButtonElement[] = [];
  private readonly canvas = h('canvas', {tabindex: 0, role: 'application'});
  private readonly legend = h('div', {class: 'legend', hidden: true});
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
          button('−', 'Zoom out', () => this.zoomMiddle(1 / 1.5)),
          button('+', 'Zoom in', () => this.zoomMiddle(1.5)),
          button('Fit', 'Whole image', () => this.fit()))),
      h('div', {class: 'canvas-holder', id: 'canvas-image'}, this.canvas, this.message, this.legend));
    this.canvas.setAttribute('aria-label', 'Camera image. Arrow keys move, plus and minus zoom, ' +
      '0 fits, Enter selects what is in the middle, brackets step along the selected line.');
    new ResizeObserver(() => this.resize()).observe(byId('canvas-image'));
    this.listen();
    app.on('result', () => this.load());
    app.on('points', () => this.prepare());
    app.on('curves', () => this.prepare());
    app.on('selection', () => this.selectionChanged());
    app.on('theme', () => this.draw());
    Object.assign(this.canvas, {pencilscanToCanvas: (u: number, v: number) =>
      ({x: this.left + (u + 0.5) * this.scale, y: this.top + (v + 0.5) * this.scale})});
  }

  private load(): void {
    const {app} = this;
    if (this.camera >= app.cameras.length) this.camera = 0;
    if (app.source.index.results[app.result] && !this.hasAnything(this.camera)) {
      const other = app.cameras.findIndex((_, c) => this.hasAnything(c));
      if (other >= 0) this.camera = other;
    }
    this.strip = app.cameras.map((camera, c) => {
      const thumb = h('canvas', {width: 96, height: 72, 'aria-hidden': 'true'});
      return h('button', {type: 'button', title: camera.name, onclick: () => this.showCamera(c)},
        thumb, h('span', {}, camera.name), h('i', {class: 'seen', 'aria-hidden': 'true'}));
    });
    this.cameraStrip.replaceChildren(...this.strip);
    this.markStrip();
    this.fit();
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

  showCamera(camera: number): void {
    if (camera === this.camera) return;
    this.camera = camera;
    this.markStrip();
    if (this.fitted) this.fit();
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
    const {result, source} = app;
    this.bitmap = null;
    const part = base === 'picture' ? `image/${camera}` : `${base}/${camera}`;
    let bitmap: CanvasImageSource | null = null;
    let reason = '';
    if (!app.rig) reason = 'The devices are not known: no camera images can be shown.';
    else if (!source.has(result, part)) {
      reason = source.index.results[result]?.detail === 'shape'
        ? 'This frame has its shape only; pencilscan view shows the images of all frames.'
        : `This result holds no ${base === 'picture' ? 'picture' : base === 'holes' ? 'hole map' : 'depth'} of ${
          app.cameras[camera]?.name ?? 'this camera'}.`;
    } else {
      try {
        bitmap = base === 'depth' ? await this.depthImage(camera) : await source.image(result, part);
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

  private async depthImage(camera: number): Promise<HTMLCanvasElement> {
    const map = await this.app.source.depth(this.app.result, camera);
    let [low, high] = [Infinity, -Infinity];
    for (const z of map.depth) {
      if (z < low) low = z;
      if (z > high) high = z;
    }
    const canvas = h('canvas', {width: map.columns, height: map.rows});
    const context = canvas.getContext('2d')!;
    const pixels = context.createImageData(map.columns, map.rows);
    map.depth.forEach((z, i) => {
      const [r, g, b] = Number.isFinite(z) ? sequential((high - z) / (high - low)) : [24, 24, 28];
      pixels.data.set([r, g, b, 255], 4 * i);
    });
    context.putImageData(pixels, 0, 0);
    canvas.dataset.low = String(low);
    canvas.dataset.high = String(high);
    canvas.dataset.source = map.source;
    return canvas;
  }

  /** Curves of this camera as one path per colour. */
  private prepare(): void {
    const {curves} = this.app;
    this.paths = [];
    this.crossings = null;
    if (curves) {
      this.makePaths(curves);
      this.crossings = new Path2D();
      for (let i = 0; i < curves.crossingU.length; ++i) {
        if (curves.crossingCamera[i] !== this.camera) continue;
        const [u, v] = [curves.crossingU[i], curves.crossingV[i]];
        this.crossings.moveTo(u + 1.6, v);
        this.crossings.arc(u, v, 1.6, 0, 7);
      }
    } else if (this.app.points) {
      this.pathsOfPoints();
    }
    this.drawLegend();
    this.draw();
  }

  private colorKey(curves: Curves, i: number): number {
    const labelled = curves.state[i] === 0;
    switch (this.layer) {
      case 'local': return curves.localId[i] === 255 ? -1 : curves.localId[i] % 8;
      case 'projector': return labelled ? curves.projector[i] % 8 : -1;
      case 'color': return curves.family[i] * 16 + curves.color[i];
      case 'confidence': return labelled
        ? Math.round((curves.confidence[i] / 255) * (kConfidenceSteps - 1)) : -1;
      default: return curves.state[i];
    }
  }

  private colorOfKey(key: number): Rgb {
    if (key < 0) return kUndecided;
    switch (this.layer) {
      case 'color': return lightColor(this.app.rig?.families[key >> 4]?.[key & 15]);
      case 'confidence': return sequential(key / (kConfidenceSteps - 1));
      case 'undecided': return (kStates[key] ?? kStates[0]).color;
      default: return category(key);
    }
  }

  private makePaths(curves: Curves): void {
    if (this.layer === 'none') return;
    const byKey = new Map<number, Path2D>();
    const end = curves.beginOfCamera[this.camera + 1] ?? curves.count;
    let last = -1; // key of the point before, on the same curve
    for (let i = curves.beginOfCamera[this.camera] ?? 0; i < end; ++i) {
      const key = this.colorKey(curves, i);
      let path = byKey.get(key);
      if (!path) byKey.set(key, (path = new Path2D()));
      const joined = i > 0 && curves.curve[i - 1] === curves.curve[i] &&
        Math.abs(curves.u[i] - curves.u[i - 1]) + Math.abs(curves.v[i] - curves.v[i - 1]) < 6;
      if (!joined) path.moveTo(curves.u[i], curves.v[i]);
      else if (last !== key) path.moveTo(curves.u[i - 1], curves.v[i - 1]);
      path.lineTo(curves.u[i], curves.v[i]);
      last = key;
    }
    // What is decided on top of what is not; reasons on top of what is labelled.
    const order = [...byKey.keys()].sort((a, b) => a - b);
    this.paths = order.map((key) => ({color: this.colorOfKey(key), path: byKey.get(key)!}));
  }

  /** Without curves.ply, the measured points alone. */
  private pathsOfPoints(): void {
    const points = this.app.points!;
    if (this.layer === 'none') return;
    const byKey = new Map<number, Path2D>();
    for (let i = 0; i < points.count; ++i) {
      if (points.camera[i] !== this.camera) continue;
      const key = this.layer === 'confidence'
        ? Math.round((points.confidence[i] / 255) * (kConfidenceSteps - 1)) : points.projector[i] % 8;
      let path = byKey.get(key);
      if (!path) byKey.set(key, (path = new Path2D()));
      path.rect(points.u[i] - 0.5, points.v[i] - 0.5, 1, 1);
    }
    for (const [key, path] of byKey) {
      this.paths.push({path, color: this.layer === 'confidence'
        ? sequential(key / (kConfidenceSteps - 1)) : category(key)});
    }
  }

  private legendEntries(): {title: string; named: Named[]} | null {
    const {rig, curves} = this.app;
    const undecided = {name: 'undecided', color: kUndecided};
    switch (this.layer) {
      case 'projector': return {title: 'Projector', named: [...(rig?.projectors ?? [])
        .map(({name}, i) => ({name, color: category(i)})), undecided]};
      case 'local': return {title: 'Local ID', named: [...Array.from({length: 8}, (_, i) =>
        ({name: String(i), color: category(i)})), undecided]};
      case 'color': return {title: 'Likeliest code colour', named: (rig?.families ?? []).flat()
        .map((name) => ({name, color: lightColor(name)}))};
      case 'undecided': {
        const present = new Set(curves?.state ?? []);
        return {title: 'Curves', named: kStates.filter((_, i) => present.has(i))};
      }
      case 'confidence': return {title: 'Confidence', named: [
        ...[0, 0.5, 0.9, 1].map((x) => ({name: String(x), color: sequential(x)})), undecided]};
      default: return null;
    }
  }

  private drawLegend(): void {
    const children: HTMLElement[] = [];
    const keys = (title: string, named: Named[]) => {
      children.push(h('strong', {}, title), ...named.map(({name, color}) =>
        h('span', {class: 'key'}, h('i', {style: `background:${css(color)}`}), name)));
    };
    const curves = this.paths.length ? this.legendEntries() : null;
    if (curves) keys(curves.title, curves.named);
    if (this.base === 'holes' && this.bitmap) keys('Ground', kHoles.slice(0, 8));
    if (this.base === 'depth' && this.bitmap instanceof HTMLCanvasElement) {
      const {low, high, source} = this.bitmap.dataset;
      const stops = [1, 0.75, 0.5, 0.25, 0].map((x) => css(sequential(x)));
      children.push(h('strong', {}, `Depth (${source})`),
        h('span', {class: 'ramp', style: `background:linear-gradient(90deg,${stops.join(',')})`}),
        h('span', {class: 'ramp-ends'}, h('span', {}, Number(low).toFixed(0)),
          h('span', {}, `${Number(high).toFixed(0)} ${this.app.rig?.unit ?? 'mm'}`)));
    }
    this.legend.replaceChildren(...children);
    this.legend.hidden = children.length === 0;
  }

  // --- what is seen of the image ---

  private size(): {width: number; height: number} {
    const holder = byId('canvas-image');
    return {width: Math.max(1, holder.clientWidth), height: Math.max(1, holder.clientHeight)};
  }

  private resize(): void {
    const {width, height} = this.size();
    const ratio = Math.min(devicePixelRatio, 2);
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    if (this.fitted) this.fit();
    this.paint();  // at once: the canvas is empty now
  }

  private fit(): void {
    const device = this.app.cameras[this.camera];
    if (!device) return;
    const {width, height} = this.size();
    this.scale = Math.min(width / device.width, height / device.height);
    this.left = (width - device.width * this.scale) / 2;
    this.top = (height - device.height * this.scale) / 2;
    this.fitted = true;
    this.draw();
  }

  private zoom(factor: number, x: number, y: number): void {
    const device = this.app.cameras[this.camera];
    if (!device) return;
    const {width} = this.size();
    const scale = Math.min(Math.max(this.scale * factor, (0.5 * width) / device.width / 2), 60);
    this.left = x - ((x - this.left) * scale) / this.scale;
    this.top = y - ((y - this.top) * scale) / this.scale;
    this.scale = scale;
    this.fitted = false;
    this.draw();
  }

  private zoomMiddle(factor: number): void {
    const {width, height} = this.size();
    this.zoom(factor, width / 2, height / 2);
  }

  private pan(dx: number, dy: number): void {
    this.left += dx;
    this.top += dy;
    this.fitted = false;
    this.draw();
  }

  private toImage(x: number, y: number): {u: number; v: number} {
    return {u: (x - this.left) / this.scale - 0.5, v: (y - this.top) / this.scale - 0.5};
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
    const ratio = this.canvas.width / this.size().width;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    if (!device) return;
    const s = this.scale * ratio;
    // Pixel centres sit at integer coordinates.
    context.setTransform(s, 0, 0, s, this.left * ratio + 0.5 * s, this.top * ratio + 0.5 * s);
    context.imageSmoothingEnabled = this.scale < 3 && this.base === 'picture';
    context.fillStyle = '#0b0d10';
    context.fillRect(-0.5, -0.5, device.width, device.height);
    if (this.bitmap) {
      context.globalAlpha = this.paths.length && this.base === 'picture' ? 0.55 : 1;
      context.drawImage(this.bitmap, -0.5, -0.5, device.width, device.height);
      context.globalAlpha = 1;
    }
    context.lineWidth = Math.max(0.8, Math.min(2.5, this.scale)) / this.scale;
    context.lineCap = 'round';
    const dots = !this.app.curves;
    for (const {color, path} of this.paths) {
      context.strokeStyle = context.fillStyle = css(color, this.scale > 8 ? 0.75 : 1);
      if (dots) context.fill(path);
      else context.stroke(path);
    }
    if (this.showCrossings.checked && this.crossings) {
      context.fillStyle = '#ffffffcc';
      context.fill(this.crossings);
    }
    this.paintSelection(context);
  }

  private paintSelection(context: CanvasRenderingContext2D): void {
    const {app} = this;
    const {selection} = app;
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
    const r = 9 / this.scale;
    context.setLineDash(hidden ? [3 / this.scale, 3 / this.scale] : []);
    for (const [width, color] of [[5, '#000a'], [2.5, '#ff3d6e']] as const) {
      context.lineWidth = width / this.scale;
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
    if (selection && selection.camera !== this.camera && !this.keepCamera) {
      this.showCamera(selection.camera);
    }
    if (selection && selection.camera === this.camera && !this.fitted) this.reveal(selection.u, selection.v);
    this.markStrip();
    this.draw();
  }
  private keepCamera = false;

  private reveal(u: number, v: number): void {
    const {width, height} = this.size();
    const x = this.left + (u + 0.5) * this.scale;
    const y = this.top + (v + 0.5) * this.scale;
    const margin = 30;
    if (x > margin && x < width - margin && y > margin && y < height - margin) return;
    this.left += width / 2 - x;
    this.top += height / 2 - y;
  }

  private listen(): void {
    const {canvas} = this;
    const pointers = new Map<number, {x: number; y: number}>();
    let moved = 0;
    canvas.addEventListener('wheel', (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * 0.0015), event.offsetX, event.offsetY);
    }, {passive: false});
    canvas.addEventListener('pointerdown', (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, {x: event.offsetX, y: event.offsetY});
      if (pointers.size === 1) moved = 0;
    });
    canvas.addEventListener('pointermove', (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const now = {x: event.offsetX, y: event.offsetY};
      moved += Math.hypot(now.x - before.x, now.y - before.y);
      if (pointers.size === 2) {
        const other = [...pointers].find(([id]) => id !== event.pointerId)![1];
        const was = Math.hypot(before.x - other.x, before.y - other.y);
        const is = Math.hypot(now.x - other.x, now.y - other.y);
        if (was > 0) this.zoom(is / was, (now.x + other.x) / 2, (now.y + other.y) / 2);
      } else if (moved > 4) {
        this.pan(now.x - before.x, now.y - before.y);
      }
      pointers.set(event.pointerId, now);
    });
    const up = (event: PointerEvent, click: boolean) => {
      const alone = pointers.size === 1;
      if (!pointers.delete(event.pointerId) || !click || !alone || moved > 4) return;
      this.select(event.offsetX, event.offsetY);
    };
    canvas.addEventListener('pointerup', (event) => up(event, true));
    canvas.addEventListener('pointercancel', (event) => up(event, false));
    canvas.addEventListener('keydown', (event) => this.key(event));
  }

  private select(x: number, y: number): void {
    const {u, v} = this.toImage(x, y);
    const reach = Math.max(1.5, 9 / this.scale);
    if (!this.app.pick(this.camera, u, v, reach)) this.app.clearSelection();
  }

  private key(event: KeyboardEvent): void {
    const {width, height} = this.size();
    const step = 40;
    const acts: Record<string, () => void> = {
      ArrowLeft: () => this.pan(step, 0), ArrowRight: () => this.pan(-step, 0),
      ArrowUp: () => this.pan(0, step), ArrowDown: () => this.pan(0, -step),
      '+': () => this.zoomMiddle(1.3), '=': () => this.zoomMiddle(1.3),
      '-': () => this.zoomMiddle(1 / 1.3), '0': () => this.fit(),
      Enter: () => this.select(width / 2, height / 2),
      '[': () => this.app.step(-1), ']': () => this.app.step(1),
      Escape: () => this.app.clearSelection(),
    };
    if (!acts[event.key]) return;
    event.preventDefault();
    acts[event.key]();
  }
}
