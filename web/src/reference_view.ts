// The frame that the shown one is compared with, in the 3-D picture.
import type {App} from './app';
import type {ColorMode} from './coloring';
import type {Mesh} from './data';
import {signedDistances} from './difference';
import {h} from './dom';
import type {Picture3d} from './scene';

export class ReferenceView {
  /** Say which half is which. */
  readonly halves = [h('span', {class: 'half left', hidden: true}), h('span', {class: 'half right', hidden: true})];
  mesh: Mesh | null = null;
  private compared = new WeakSet<Mesh>(); // with `mesh`

  constructor(private readonly app: App) {}

  /** Reads the mesh; false when another frame was chosen meanwhile. */
  async read(): Promise<boolean> {
    const {app} = this;
    const wanted = app.reference;
    const mesh = wanted && await app.source.mesh(wanted.result, 'mesh').catch(() => null);
    if (app.reference !== wanted) return false;
    this.mesh = mesh;
    this.compared = new WeakSet();
    return true;
  }

  /** The mode that shows what is asked for. */
  modeFor(mode: ColorMode): ColorMode {
    if (this.app.reference?.how === 'difference' && this.mesh) return 'difference';
    return mode === 'difference' ? 'shading' : mode;
  }

  /** Measures a mesh against the reference, once. */
  compare(mesh: Mesh): void {
    if (!this.mesh || this.compared.has(mesh)) return;
    mesh.difference = signedDistances(mesh, this.mesh);
    this.compared.add(mesh);
  }

  /** The other frame beside this one, in the same colours. */
  draw(picture: Picture3d, colorsOf: (mesh: Mesh) => Float32Array): void {
    const {app} = this;
    const beside = app.reference?.how === 'beside' ? this.mesh : null;
    const results = app.source.index.results;
    this.halves.forEach((half) => (half.hidden = !beside));
    this.halves[0].textContent = 'this frame';
    this.halves[1].textContent = results[app.reference?.result ?? 0]?.name ?? '';
    if (beside) picture.setOther(beside, colorsOf(beside));
    else picture.setOther(null);
  }
}
