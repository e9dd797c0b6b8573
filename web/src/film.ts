// Meshes of a sequence, read ahead of what is shown; as many are kept as fit into a fixed room.
import type {Mesh, Source} from './data';

const kRoom = 192e6; // bytes of all meshes kept
const kAhead = 6; // frames: some may take longer than others

const bytesOf = (mesh: Mesh): number =>
  Object.values(mesh).reduce((sum, array) => sum + (ArrayBuffer.isView(array) ? array.byteLength : 0), 0);

export class Film {
  private readonly kept = new Map<number, {mesh: Promise<Mesh | null>; bytes: number}>();
  private room = kRoom;
  private thousands = 20;

  constructor(private readonly source: Source) {}

  /** Of each mesh, where the source makes a difference. */
  set faces(thousands: number) {
    this.thousands = thousands;
    this.kept.clear();
    this.room = kRoom;
  }

  /** The mesh of a frame; `next` are the ones that are wanted after it. */
  get(result: number, next: number[] = []): Promise<Mesh | null> {
    const mesh = this.ask(result);
    for (const other of next.slice(0, kAhead)) void this.ask(other);
    return mesh;
  }

  private ask(result: number): Promise<Mesh | null> {
    const known = this.kept.get(result);
    if (known) {
      this.kept.delete(result); // the last ones asked for are kept longest
      this.kept.set(result, known);
      return known.mesh;
    }
    const has = this.source.has(result, 'mesh');
    const read = has ? this.source.mesh(result, 'mesh', this.thousands).catch(() => null) : Promise.resolve(null);
    const entry = {mesh: read, bytes: 0};
    this.kept.set(result, entry);
    void read.then((mesh) => {
      if (this.kept.get(result) !== entry) return;
      if (!mesh) {
        if (has) this.kept.delete(result); // what could not be read is asked for again
        return;
      }
      entry.bytes = bytesOf(mesh);
      this.room -= entry.bytes;
      this.forget();
    });
    return read;
  }

  private forget(): void {
    for (const [result, {bytes}] of this.kept) {
      if (this.room >= 0) return;
      this.kept.delete(result);
      this.room += bytes;
    }
  }
}
