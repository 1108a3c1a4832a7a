// Draws dtact-perceive's data in 3D: the contact's points, lit by their normals, and the axes of the
// object, which show its motion since contact began. Loaded when a sensor has such data.
import {
  AxesHelper,
  BufferAttribute,
  BufferGeometry,
  GLSL3,
  Points,
  RawShaderMaterial,
} from "three";
import { el, say } from "../dom";
import type { Cloud, Frame } from "../session/messages";
import { placeAxes } from "./axes";
import { Space } from "./space";

const AXES_MM = 3;

// Each coordinate is an array of its own, in units, as the wire has them.
const VERTEX = `
precision highp float;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform float mmPerUnit;
uniform float pixels;
in float x;
in float y;
in float z;
in float normalX;
in float normalY;
in float normalZ;
out vec3 normal;

void main() {
  // From the surface frame, whose z points from the camera to the object.
  vec3 there = mmPerUnit * vec3(x, -y, -z);
  normal = normalize(mat3(modelViewMatrix) * vec3(normalX, -normalY, -normalZ));
  vec4 seen = modelViewMatrix * vec4(there, 1.0);
  gl_Position = x < -32767.5 ? vec4(2.0, 2.0, 2.0, 1.0) : projectionMatrix * seen;
  gl_PointSize = clamp(pixels / -seen.z, 1.0, 24.0);
}`;

const FRAGMENT = `
precision highp float;
in vec3 normal;
out vec4 colour;
void main() {
  // From the left and low, so that a shallow dent has a lit and a dark side.
  vec3 facing = normal.z < 0.0 ? -normal : normal;
  float lit = 0.15 + 0.85 * max(0.0, dot(facing, normalize(vec3(-0.75, 0.35, 0.55))));
  colour = vec4(lit * vec3(0.30, 0.72, 0.68), 1.0);
}`;

const PARTS = ["x", "y", "z", "normalX", "normalY", "normalZ"];

export class CloudView {
  private readonly space: Space;
  private readonly uniforms = { mmPerUnit: { value: 0.001 }, pixels: { value: 1 } };
  private readonly material = new RawShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: this.uniforms,
  });
  private readonly points = new Points(new BufferGeometry(), this.material);
  private readonly axes = new AxesHelper(AXES_MM);
  private readonly reported = el("output", { class: "row corner", "data-fact": "points" });

  constructor(host: HTMLElement) {
    this.space = new Space(host, "Points of the contact; drag to turn, wheel to zoom");
    host.append(this.reported);
    // Their true extent is the shader's to know.
    this.points.frustumCulled = false;
    this.space.scene.add(this.points, this.axes);
    this.clear();
  }

  show(frame: Frame): void {
    if (frame.contact?.inContact === false) return this.clear();
    if (frame.cloud) this.draw(frame.cloud);
    placeAxes(this.axes, frame.pose);
    this.space.render();
  }

  close(): void {
    this.space.close();
  }

  private clear(): void {
    this.points.visible = this.axes.visible = false;
    say(this.reported, "No contact, so no points.");
    this.space.render();
  }

  private draw(cloud: Cloud): void {
    const size = cloud.width * cloud.height;
    this.points.geometry.dispose();
    const geometry = new BufferGeometry();
    PARTS.forEach((part, at) => {
      const values = cloud.values.subarray(at * size, (at + 1) * size);
      geometry.setAttribute(part, new BufferAttribute(values, 1));
    });
    geometry.setDrawRange(0, size);
    this.points.geometry = geometry;
    this.points.visible = true;
    const apartMm = this.apartMm(cloud);
    this.uniforms.mmPerUnit.value = cloud.mmPerUnit;
    this.uniforms.pixels.value = 1.5 * apartMm * this.space.pixelsPerMm;
    say(this.reported, `${cloud.points} points, ${apartMm.toFixed(3)} mm apart`);
  }

  /** From one point to the next in a row, by the first that has a neighbour. */
  private apartMm(cloud: Cloud): number {
    const { values, width, height } = cloud;
    for (let at = 0; at + 1 < width * height; ++at) {
      const [here, next] = [values[at] as number, values[at + 1] as number];
      if ((at + 1) % width !== 0 && here > -32768 && next > here) {
        return (next - here) * cloud.mmPerUnit;
      }
    }
    return 0.1;
  }
}
