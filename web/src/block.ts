// Reads what src/pencilscan/page/block.h writes.

interface ArrayHeader {
  type: 'u8' | 'u16' | 'u32' | 'f16';
  count: number;
  at: number;
  low?: number;
  step?: number;
  logarithmic?: boolean;
}

export async function inflate(bytes: Uint8Array<ArrayBuffer>): Promise<Uint8Array<ArrayBuffer>> {
  const stream = new Response(bytes).body!.pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

export async function inflateJson<T>(bytes: Uint8Array<ArrayBuffer>): Promise<T> {
  return JSON.parse(new TextDecoder().decode(await inflate(bytes))) as T;
}

/** Undoes zigzag-coded differences in byte planes. */
function undoDifferences(data: Uint8Array, at: number, count: number, bytes: 2 | 4): Uint32Array {
  const values = new Uint32Array(count);
  let last = 0;
  const mask = bytes === 2 ? 0xffff : 0xffffffff;
  for (let i = 0; i < count; ++i) {
    let code = data[at + i] | (data[at + count + i] << 8);
    if (bytes === 4) code |= (data[at + 2 * count + i] << 16) | (data[at + 3 * count + i] << 24);
    const difference = (code >>> 1) ^ -(code & 1);
    last = (last + difference) & mask;
    values[i] = last;
  }
  return values;
}

export class Block {
  private constructor(
    private readonly header: {arrays: Record<string, ArrayHeader>} & Record<string, unknown>,
    private readonly data: Uint8Array,
  ) {}

  static async read(compressed: Uint8Array<ArrayBuffer>): Promise<Block> {
    const bytes = await inflate(compressed);
    const length = new DataView(bytes.buffer).getUint32(0, true);
    const header = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
    return new Block(header, bytes.subarray(4 + length));
  }

  value<T>(key: string): T {
    return this.header[key] as T;
  }

  has(name: string): boolean {
    return name in this.header.arrays;
  }

  private array(name: string): ArrayHeader {
    const header = this.header.arrays[name];
    if (!header) throw new Error(`the data has no ${name}`);
    return header;
  }

  bytes(name: string): Uint8Array {
    const {at, count} = this.array(name);
    return this.data.subarray(at, at + count);
  }

  integers(name: string): Uint32Array {
    const {at, count, type} = this.array(name);
    return undoDifferences(this.data, at, count, type === 'u32' ? 4 : 2);
  }

  /** NaN where there is no value. */
  floats(name: string): Float32Array {
    const {at, count, low = 0, step = 1, logarithmic} = this.array(name);
    const codes = undoDifferences(this.data, at, count, 2);
    const values = new Float32Array(count);
    for (let i = 0; i < count; ++i) {
      const x = low + step * codes[i];
      values[i] = codes[i] === 65535 ? NaN : logarithmic ? Math.exp(x) : x;
    }
    return values;
  }
}

/** The arrays of unpacked_mesh() in src/pencilscan/page/geometry_blocks.h, as they lie in `bytes`. */
export class Unpacked {
  private readonly header: {arrays: Record<string, {at: number; count: number}>};
  private readonly begin: number;

  constructor(private readonly bytes: Uint8Array<ArrayBuffer>) {
    const length = new DataView(bytes.buffer).getUint32(0, true);
    this.begin = 4 + length;
    this.header = JSON.parse(new TextDecoder().decode(bytes.subarray(4, this.begin)));
  }

  array<T>(name: string, type: new (buffer: ArrayBuffer, at: number, count: number) => T): T | undefined {
    const found = this.header.arrays[name];
    return found && new type(this.bytes.buffer, this.begin + found.at, found.count);
  }
}
