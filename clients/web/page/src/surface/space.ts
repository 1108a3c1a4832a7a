// A scene that is looked at from all sides: three.js' renderer, a camera and what turns it. Millimetres;
// x to the right and y up as the sensor's camera sees it, z towards that camera.
import { Color, PerspectiveCamera, Scene, SRGBColorSpace, Vector3, WebGLRenderer } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

export class Space {
  readonly scene = new Scene();
  private readonly renderer = new WebGLRenderer({ antialias: true, alpha: true });
  private readonly camera = new PerspectiveCamera(35, 1, 0.1, 500);
  private readonly controls: OrbitControls;
  private readonly pixel = new Uint8Array(4);
  private readonly observer = new ResizeObserver(() => this.fit());

  /** Fills `host`, whatever size it has. */
  constructor(
    private readonly host: HTMLElement,
    label: string,
  ) {
    // Colours are for the screen as they are.
    this.renderer.outputColorSpace = SRGBColorSpace;
    this.renderer.setClearColor(new Color(0, 0, 0), 0);
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 1.5));
    this.renderer.domElement.setAttribute("aria-label", label);
    host.append(this.renderer.domElement);
    this.camera.position.set(0, -30, 26);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.target = new Vector3(0, 0, 0);
    this.controls.minDistance = 4;
    this.controls.maxDistance = 120;
    this.controls.addEventListener("change", () => this.render());
    this.observer.observe(host);
    this.fit();
  }

  /** Leaves the host empty. */
  close(): void {
    this.observer.disconnect();
    this.controls.dispose();
    this.renderer.dispose();
    this.host.replaceChildren();
  }

  render(): void {
    this.renderer.render(this.scene, this.camera);
  }

  /** Renders once more and says how long it took to be done, milliseconds. */
  renderMs(): number {
    const gl = this.renderer.getContext();
    const began = performance.now();
    this.render();
    // Reading a pixel waits until the picture is done.
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, this.pixel);
    return performance.now() - began;
  }

  /** Screen pixels of a millimetre at a distance of one. */
  get pixelsPerMm(): number {
    const height = this.renderer.domElement.height;
    return height / (2 * Math.tan((this.camera.fov * Math.PI) / 360));
  }

  private fit(): void {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.render();
  }
}
