// Where an image lies on a canvas: fitted, zoomed and moved by mouse, fingers and keys.

interface Size {
  width: number;
  height: number;
}

export class ImageView {
  scale = 1; // CSS pixels per image pixel
  left = 0; // of the image's corner, CSS pixels
  top = 0;
  fitted = true;

  /** image: its size in pixels, or null for none. changed: to be drawn again. */
  constructor(
    private readonly canvas: HTMLCanvasElement, private readonly image: () => Size | null,
    private readonly changed: () => void, clicked: (x: number, y: number) => void,
  ) {
    this.listen(clicked);
  }

  size(): Size {
    const holder = this.canvas.parentElement!;
    return {width: Math.max(1, holder.clientWidth), height: Math.max(1, holder.clientHeight)};
  }

  fit(): void {
    const image = this.image();
    if (!image) return;
    const {width, height} = this.size();
    this.scale = Math.min(width / image.width, height / image.height);
    this.left = (width - image.width * this.scale) / 2;
    this.top = (height - image.height * this.scale) / 2;
    this.fitted = true;
    this.changed();
  }

  /** The place (x, y) on the canvas stays. */
  zoom(factor: number, x: number, y: number): void {
    const image = this.image();
    if (!image) return;
    const {width} = this.size();
    const scale = Math.min(Math.max(this.scale * factor, (0.25 * width) / image.width), 60);
    this.left = x - ((x - this.left) * scale) / this.scale;
    this.top = y - ((y - this.top) * scale) / this.scale;
    this.scale = scale;
    this.fitted = false;
    this.changed();
  }

  zoomMiddle(factor: number): void {
    const {width, height} = this.size();
    this.zoom(factor, width / 2, height / 2);
  }

  pan(dx: number, dy: number): void {
    this.left += dx;
    this.top += dy;
    this.fitted = false;
    this.changed();
  }

  /** Pixel centres sit at integer coordinates. */
  toImage(x: number, y: number): {u: number; v: number} {
    return {u: (x - this.left) / this.scale - 0.5, v: (y - this.top) / this.scale - 0.5};
  }

  toCanvas(u: number, v: number): {x: number; y: number} {
    return {x: this.left + (u + 0.5) * this.scale, y: this.top + (v + 0.5) * this.scale};
  }

  /** Moves a pixel to the middle unless it is well in sight. */
  reveal(u: number, v: number): void {
    const {width, height} = this.size();
    const {x, y} = this.toCanvas(u, v);
    const margin = 30;
    if (x > margin && x < width - margin && y > margin && y < height - margin) return;
    this.left += width / 2 - x;
    this.top += height / 2 - y;
  }

  private listen(clicked: (x: number, y: number) => void): void {
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
      clicked(event.offsetX, event.offsetY);
    };
    canvas.addEventListener('pointerup', (event) => up(event, true));
    canvas.addEventListener('pointercancel', (event) => up(event, false));
  }
}
