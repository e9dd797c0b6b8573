// The 3-D picture: mesh, points and helpers, drawn when something changed.
import {
  AmbientLight, BufferAttribute, BufferGeometry, Color, DirectionalLight, DoubleSide, FrontSide, Group,
  HemisphereLight, Mesh as ThreeMesh, MeshLambertMaterial, PerspectiveCamera, type Plane, Points as ThreePoints,
  PointsMaterial, Raycaster, Scene, Sphere, Vector2, Vector3, WebGLRenderer,
} from 'three';
import {OrbitControls} from 'three/examples/jsm/controls/OrbitControls.js';
import type {Device} from './device';
import {vertexNormals} from './normals';

const kFov = 35; // degrees, of the free view

/** A renderer; without a graphics card, smooth edges and fine pixels would cost many times the time. */
function makeRenderer(): WebGLRenderer {
  const canvas = document.createElement('canvas');
  const context = canvas.getContext('webgl2', {
    alpha: true, antialias: false, powerPreference: 'low-power'});
  if (!context) throw new Error('no WebGL 2');
  const info = context.getExtension('WEBGL_debug_renderer_info');
  const name = String(context.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : context.RENDERER));
  if (/swiftshader|llvmpipe|software|basic render/i.test(name)) {
    const renderer = new WebGLRenderer({canvas, context});
    renderer.setPixelRatio(1);
    return renderer;
  }
  context.getExtension('WEBGL_lose_context')?.loseContext();
  const renderer = new WebGLRenderer({antialias: true, powerPreference: 'low-power'});
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  return renderer;
}

interface Triangles {
  position: Float32Array;
  index: Uint32Array;
}

function fill(mesh: ThreeMesh, geometry: Triangles | null): void {
  mesh.geometry.dispose();
  mesh.geometry = new BufferGeometry();
  if (geometry) {
    mesh.geometry.setAttribute('position', new BufferAttribute(geometry.position, 3));
    mesh.geometry.setAttribute('normal', new BufferAttribute(vertexNormals(geometry.position, geometry.index), 3));
    mesh.geometry.setIndex(new BufferAttribute(geometry.index, 1));
  }
  mesh.visible = geometry !== null;
}

export class Picture3d {
  readonly camera = new PerspectiveCamera(kFov, 1, 1, 10000);
  readonly helpers = new Group(); // devices, planes, markers: not picked, not fitted
  private readonly renderer = makeRenderer();
  private readonly scene = new Scene();
  private readonly headlight = new DirectionalLight(0xffffff, 1.9);
  private controls: OrbitControls;
  private readonly mesh = new ThreeMesh(
    new BufferGeometry(), new MeshLambertMaterial({vertexColors: true, side: DoubleSide}));
  private readonly other = new ThreeMesh(new BufferGeometry(), this.mesh.material); // beside it
  private readonly points = new ThreePoints(
    new BufferGeometry(), new PointsMaterial({vertexColors: true, sizeAttenuation: false, size: 2}));
  private readonly up = new Vector3(0, 0, 1);
  private home: [number, number, number] = [1, -0.55, 0.4];
  private ball = new Sphere(new Vector3(), 100);
  private deviceView: Device | null = null;
  private pending = false;
  private shapeDrawn = false;
  private drawn = false; // once at least
  private cut: Plane | null = null;
  beforeRender: (() => void) | null = null;

  constructor(private readonly container: HTMLElement) {
    const canvas = this.renderer.domElement;
    canvas.tabIndex = 0;
    container.append(canvas);
    this.camera.up.set(0, 0, 1);
    this.scene.add(new HemisphereLight(0xffffff, 0x667788, 0.9), new AmbientLight(0xffffff, 0.25),
      this.camera, this.mesh, this.other, this.points, this.helpers);
    this.headlight.position.set(-0.5, 0.7, 1);
    this.camera.add(this.headlight, this.headlight.target);
    this.headlight.target.position.set(0, 0, -1);
    for (const object of [this.mesh, this.other, this.points]) {
      object.frustumCulled = false;
      object.visible = false;
    }
    this.controls = this.makeControls();
    new ResizeObserver(() => this.resize()).observe(container);
    canvas.addEventListener('keydown', (event) => this.key(event));
    canvas.addEventListener('webglcontextrestored', () => this.render());
  }

  get canvas(): HTMLCanvasElement {
    return this.renderer.domElement;
  }

  private makeControls(target?: Vector3): OrbitControls {
    const controls = new OrbitControls(this.camera, this.renderer.domElement);
    controls.zoomToCursor = true;
    if (target) controls.target.copy(target);
    controls.addEventListener('change', () => this.render());
    controls.addEventListener('start', () => this.leaveDeviceView());
    return controls;
  }

  setBackground(color: string): void {
    this.scene.background = new Color(color);
    this.render();
  }

  /** closed: seen from outside only, so that half of its faces need no colour. */
  setMesh(geometry: Triangles | null, closed = false): void {
    fill(this.mesh, geometry);
    this.mesh.material.side = closed && !this.cut ? FrontSide : DoubleSide;
    this.render();
  }

  /** A second mesh, in the right half of the picture; the first one keeps the left half. */
  setOther(geometry: Triangles | null, colors?: Float32Array): void {
    const before = this.beside;
    fill(this.other, geometry);
    if (colors) this.other.geometry.setAttribute('color', new BufferAttribute(colors, 3));
    if (before !== this.beside) this.resize();
    this.render();
  }

  private get beside(): boolean {
    return this.other.visible;
  }

  setPoints(position: Float32Array | null): void {
    this.points.geometry.dispose();
    this.points.geometry = new BufferGeometry();
    if (position) this.points.geometry.setAttribute('position', new BufferAttribute(position, 3));
    this.points.visible = position !== null;
    this.render();
  }

  setColors(of: 'mesh' | 'points', colors: Float32Array): void {
    const object = of === 'mesh' ? this.mesh : this.points;
    object.geometry.setAttribute('color', new BufferAttribute(colors, 3));
    this.render();
  }

  set pointSize(size: number) {
    this.points.material.size = size;
    this.render();
  }

  /** What is up in the free view, and from where fit() looks when it is not told. */
  setHome(up: [number, number, number], direction: [number, number, number]): void {
    if (Math.hypot(...up) > 0) this.up.set(...up).normalize();
    this.home = direction;
  }

  /** The sphere that fit() shows. */
  setBounds(center: [number, number, number], radius: number): void {
    this.ball = new Sphere(new Vector3(...center), radius);
    this.camera.near = radius / 100;
    this.camera.far = radius * 400;
    this.controls.maxDistance = radius * 100;
    this.controls.minDistance = radius / 50;
  }

  get bounds(): Sphere {
    return this.ball;
  }

  /** Everything of interest from direction (x, y, z) seen from the middle; larger: of this many
   * times the size. */
  fit(direction = this.home, larger = 1): void {
    this.deviceView = null;
    const {width, height} = this.size();
    this.camera.up.copy(this.up);
    this.camera.fov = kFov;
    const half = (kFov / 2) * (Math.PI / 180);
    const narrow = this.beside ? 1 : Math.min(1, width / height);
    const distance = larger * this.ball.radius / Math.sin(Math.atan(Math.tan(half) * narrow));
    this.camera.position.copy(this.ball.center)
      .addScaledVector(new Vector3(...direction).normalize(), distance);
    this.resetControls(this.ball.center);
  }

  private resetControls(target: Vector3): void {
    this.controls.dispose();
    this.controls = this.makeControls(target);
    this.controls.maxDistance = this.ball.radius * 100;
    this.controls.minDistance = this.ball.radius / 50;
    this.controls.update();
    this.resize();
  }

  /** What a device sees: its place, direction and field of view (without distortion). */
  viewFrom(device: Device): void {
    this.camera.up.set(...device.axis(1)).negate();
    this.camera.position.set(...device.center);
    const forward = new Vector3(...device.axis(2));
    const depth = this.ball.center.clone().sub(this.camera.position).dot(forward);
    const target = this.camera.position.clone()
      .addScaledVector(forward, Math.max(depth, this.ball.radius / 10));
    this.deviceView = device;
    this.resetControls(target);
  }

  private leaveDeviceView(): void {
    if (!this.deviceView) return;
    // Keep what is seen, from a camera with its principal point in the middle.
    this.deviceView = null;
    this.camera.clearViewOffset();
    this.camera.updateProjectionMatrix();
  }

  /** Of the picture of one mesh, CSS pixels. */
  private size(): {width: number; height: number} {
    return {
      width: Math.max(1, this.container.clientWidth / (this.beside ? 2 : 1)),
      height: Math.max(1, this.container.clientHeight),
    };
  }

  private resize(): void {
    const {width, height} = this.size();
    const now = this.renderer.getSize(new Vector2());
    const whole = Math.max(1, this.container.clientWidth);
    const resized = now.x !== whole || now.y !== height;
    if (resized) this.renderer.setSize(whole, height);
    this.camera.aspect = width / height;
    if (this.deviceView) {
      const {K, width: w, height: h} = this.deviceView.json;
      // The whole image of the device fits into the canvas.
      const scale = Math.min(width / w, height / h);
      this.camera.fov = 2 * Math.atan(height / (2 * scale * K[1][1])) * (180 / Math.PI);
      const shiftX = (K[0][2] - (w - 1) / 2) * scale;
      const shiftY = (K[1][2] - (h - 1) / 2) * scale;
      this.camera.setViewOffset(width, height, -shiftX, -shiftY, width, height);
    } else {
      // A shape that filled the whole picture fits into half of it.
      const narrow = this.beside ? Math.min(1, width / height) : 1;
      this.camera.fov = 2 * Math.atan(Math.tan((kFov / 2) * (Math.PI / 180)) / narrow) * (180 / Math.PI);
      this.camera.clearViewOffset();
    }
    this.camera.updateProjectionMatrix();
    if (resized && this.drawn) this.draw(); // at once: the canvas is empty now
    else this.render();
  }

  render(): void {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => this.draw());
  }

  private draw(): void {
    this.pending = false;
    this.drawn = true;
    this.camera.updateMatrixWorld();
    this.beforeRender?.();
    if (this.beside) this.drawBeside();
    else this.renderer.render(this.scene, this.camera);
    if (!this.shapeDrawn && (this.mesh.visible || this.points.visible)) {
      this.shapeDrawn = true;
      performance.mark('shape-drawn'); // for web/benchmark.mjs
    }
  }

  /** Hides what of meshes and points lies behind a plane. */
  setCut(plane: Plane | null): void {
    this.cut = plane;
    this.renderer.localClippingEnabled = true; // devices and markers stay whole
    this.mesh.material.clippingPlanes = this.points.material.clippingPlanes = plane ? [plane] : [];
    this.render();
  }

  /** CSS pixels of one unit of length, in the middle of what is looked at. */
  pixelsPerUnit(): number {
    const {height} = this.size();
    const away = this.controls.target.clone().sub(this.camera.position)
      .dot(this.camera.getWorldDirection(new Vector3()));
    return height / (2 * away * Math.tan((this.camera.fov / 2) * (Math.PI / 180)));
  }

  /** The mesh and all that belongs to it on the left, the other one on the right. */
  private drawBeside(): void {
    const {renderer, mesh, other, points, helpers} = this;
    const {width, height} = this.size();
    const shown = [mesh, points, helpers].map((object) => ({object, visible: object.visible}));
    renderer.setScissorTest(true);
    for (const half of [0, 1]) {
      renderer.setViewport(half * width, 0, width, height);
      renderer.setScissor(half * width, 0, width, height);
      for (const {object, visible} of shown) object.visible = visible && half === 0;
      other.visible = half === 1;
      renderer.render(this.scene, this.camera);
    }
    for (const {object, visible} of shown) object.visible = visible;
    renderer.setScissorTest(false);
    renderer.setViewport(0, 0, 2 * width, height);
  }

  screenshot(): Promise<Blob | null> {
    this.draw();
    return new Promise((done) => this.canvas.toBlob(done, 'image/png'));
  }

  private key(event: KeyboardEvent): void {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const up = this.camera.up.clone().normalize();
    const right = up.clone().cross(offset).normalize();
    const step = 0.12;
    const turn: Record<string, () => void> = {
      ArrowLeft: () => offset.applyAxisAngle(up, -step),
      ArrowRight: () => offset.applyAxisAngle(up, step),
      ArrowUp: () => this.tilt(offset, up, right, -step),
      ArrowDown: () => this.tilt(offset, up, right, step),
      '+': () => offset.multiplyScalar(0.85),
      '=': () => offset.multiplyScalar(0.85),
      '-': () => offset.multiplyScalar(1 / 0.85),
    };
    if (event.key === '0') this.fit();
    else if (turn[event.key]) {
      this.leaveDeviceView();
      turn[event.key]();
      this.camera.position.copy(this.controls.target).add(offset);
      this.controls.update();
    } else return;
    event.preventDefault();
    this.render();
  }

  private tilt(offset: Vector3, up: Vector3, right: Vector3, angle: number): void {
    const now = offset.angleTo(up);
    const next = Math.min(Math.max(now + angle, 0.05), Math.PI - 0.05);
    offset.applyAxisAngle(right, next - now);
  }

  /** Canvas position (CSS pixels) to normalized device coordinates. */
  private normalized(x: number, y: number): Vector2 {
    const {width, height} = this.size();
    return new Vector2((2 * x) / width - 1, 1 - (2 * y) / height);
  }

  /** Where the ray through a canvas position meets a mesh, and the nearest corner of the face there.
   * beside: of the mesh in the right half. */
  meshHit(x: number, y: number): {point: Vector3; vertex: number; beside: boolean} | null {
    const beside = this.beside && x >= this.size().width;
    const mesh = beside ? this.other : this.mesh;
    if (!mesh.visible) return null;
    const caster = new Raycaster();
    caster.setFromCamera(this.normalized(beside ? x - this.size().width : x, y), this.camera);
    const hit = caster.intersectObject(mesh, false)
      .find(({point}) => !this.cut || this.cut.distanceToPoint(point) >= 0);
    if (!hit?.face) return null;
    const place = mesh.geometry.getAttribute('position');
    const away = (vertex: number) => new Vector3().fromBufferAttribute(place, vertex).distanceTo(hit.point);
    const {a, b, c} = hit.face;
    const vertex = [b, c].reduce((best, v) => (away(v) < away(best) ? v : best), a);
    return {point: hit.point, vertex, beside};
  }

  /** Index of the frontmost of `position`s within `reach` CSS pixels of a canvas position. */
  pointHit(position: Float32Array, x: number, y: number, reach: number): number {
    const {width, height} = this.size();
    const e = this.camera.projectionMatrix.clone().multiply(this.camera.matrixWorldInverse).elements;
    let best = -1;
    let bestCost = Infinity;
    for (let i = 0; i < position.length / 3; ++i) {
      const [a, b, c] = [position[3 * i], position[3 * i + 1], position[3 * i + 2]];
      const w = e[3] * a + e[7] * b + e[11] * c + e[15];
      if (w <= 0) continue;
      const dx = ((e[0] * a + e[4] * b + e[8] * c + e[12]) / w + 1) * width / 2 - x;
      if (Math.abs(dx) > reach) continue;
      const dy = (1 - (e[1] * a + e[5] * b + e[9] * c + e[13]) / w) * height / 2 - y;
      const away = Math.hypot(dx, dy);
      if (away > reach) continue;
      // One pixel aside weighs as much as 1 % of the shape's size behind.
      const cost = w + away * 0.02 * this.ball.radius;
      if (cost < bestCost) {
        bestCost = cost;
        best = i;
      }
    }
    return best;
  }

  /** Canvas position of a world point. */
  toCanvas(point: Vector3): {x: number; y: number; front: boolean} {
    const {width, height} = this.size();
    const p = point.clone().project(this.camera);
    return {x: (p.x + 1) * width / 2, y: (1 - p.y) * height / 2, front: p.z < 1};
  }
}
