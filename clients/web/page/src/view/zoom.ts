// Which part of the picture is shown: all of it, or a window that wheel, fingers and keys change.

const MAX_ZOOM = 16;

const clamp = (value: number, low: number, high: number): number =>
  Math.min(Math.max(value, low), high);

export class Zoom {
  factor = 1;
  /** Upper left corner of the window, as shares of the picture. */
  left = 0;
  top = 0;

  /** The place in the picture of a place in the window; both are shares. */
  toPicture(x: number, y: number): [number, number] {
    return [this.left + x / this.factor, this.top + y / this.factor];
  }

  /** Zooms, and keeps what is at (x, y) of the window where it is. */
  about(x: number, y: number, factor: number): void {
    const [pictureX, pictureY] = this.toPicture(x, y);
    this.factor = clamp(this.factor * factor, 1, MAX_ZOOM);
    this.moveTo(pictureX - x / this.factor, pictureY - y / this.factor);
  }

  /** Moves the picture by shares of the window. */
  pan(x: number, y: number): void {
    this.moveTo(this.left - x / this.factor, this.top - y / this.factor);
  }

  reset(): void {
    this.factor = 1;
    this.moveTo(0, 0);
  }

  private moveTo(left: number, top: number): void {
    const last = 1 - 1 / this.factor;
    this.left = clamp(left, 0, last);
    this.top = clamp(top, 0, last);
  }
}
