// The surface in space: the depth map as a height field, at true scale or exaggerated. Loaded when it
// is looked at for the first time.
import {
  BufferAttribute,
  BufferGeometry,
  ClampToEdgeWrapping,
  DataTexture,
  FloatType,
  GLSL3,
  Mesh,
  NearestFilter,
  RawShaderMaterial,
  RedFormat,
  RGBAFormat,
  Sphere,
  Vector3,
} from "three";
import { el, say } from "../dom";
import type { DepthMap } from "../session/messages";
import { colourMap, COLOURS } from "../view/colour_map";
import type { Range } from "../view/map_canvas";
import { Space } from "./space";

/** Points along the longer side; halved as long as a picture takes too long. */
const FINEST = 290;
const COARSEST = 72;
const SLOW_MS = 12;
const JUDGED_EVERY = 4;

const VERTEX = `
precision highp float;
precision highp int;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform sampler2D depths;
uniform vec2 grid;
uniform float spacingMm;
uniform vec3 viewpoint;
uniform float exaggeration;
in vec2 position;
out vec3 normal;
out float depthMm;

float heightAt(ivec2 at) {
  float mm = texelFetch(depths, clamp(at, ivec2(0), ivec2(grid) - 1), 0).r;
  return mm < -99.0 ? 0.0 : mm * exaggeration;
}

void main() {
  vec2 pixel = position;
  ivec2 at = ivec2(pixel);
  depthMm = texelFetch(depths, at, 0).r;
  float height = depthMm < -99.0 ? 0.0 : depthMm * exaggeration;
  // As the camera sees it, from inside the sensor: what is pressed comes towards the viewer, and left
  // and right are those of the map. Seen from outside it would be mirrored.
  vec2 flat_mm = (pixel - 0.5 * (grid - 1.0)) * spacingMm;
  if (depthMm > -99.0) flat_mm -= (flat_mm - viewpoint.xy) * viewpoint.z * depthMm;
  vec4 seen = modelViewMatrix * vec4(flat_mm.x, -flat_mm.y, height, 1.0);
  vec2 slope = 0.5 / spacingMm * vec2(heightAt(at + ivec2(1, 0)) - heightAt(at - ivec2(1, 0)),
                                      heightAt(at - ivec2(0, 1)) - heightAt(at + ivec2(0, 1)));
  normal = mat3(modelViewMatrix) * normalize(vec3(-slope, 1.0));
  gl_Position = projectionMatrix * seen;
}`;

const FRAGMENT = `
precision highp float;
precision highp int;
uniform sampler2D colours;
uniform float fromMm;
uniform float toMm;
in vec3 normal;
in float depthMm;
out vec4 colour;
void main() {
  float lit = 0.5 + 0.5 * abs(dot(normalize(normal), normalize(vec3(-0.45, 0.55, 0.7))));
  float share = clamp((depthMm - fromMm) / (toMm - fromMm), 0.0, 0.999);
  vec3 base = depthMm < -99.0 ? vec3(0.5) : texelFetch(colours, ivec2(share * ${COLOURS}.0, 0), 0).rgb;
  colour = vec4(base * lit, 1.0);
}`;

function gridGeometry(columns: number, rows: number): BufferGeometry {
  const positions = new Float32Array(2 * columns * rows);
  const indices = new Uint32Array(6 * (columns - 1) * (rows - 1));
  let at = 0;
  for (let row = 0; row < rows; ++row) {
    for (let column = 0; column < columns; ++column) {
      positions[at++] = column;
      positions[at++] = row;
    }
  }
  at = 0;
  for (let row = 0; row + 1 < rows; ++row) {
    for (let column = 0; column + 1 < columns; ++column) {
      const corner = row * columns + column;
      indices.set(
        [corner, corner + columns, corner + 1, corner + 1, corner + columns, corner + columns + 1],
        at,
      );
      at += 6;
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(positions, 2));
  geometry.setIndex(new BufferAttribute(indices, 1));
  return geometry;
}

export class SurfaceView {
  private readonly space: Space;
  private readonly material: RawShaderMaterial;
  private mesh: Mesh | undefined;
  private values = new Float32Array(0);
  private texture: DataTexture | undefined;
  private finest = FINEST;
  private shape = "";
  private pictures = 0;
  private readonly scale = el("input", {
    type: "range",
    min: "1",
    max: "10",
    step: "0.5",
    value: "3",
    "aria-label": "Exaggeration of depth",
  });
  private readonly reported = el("output", {}, "3 ×");

  constructor(private readonly host: HTMLElement) {
    const colours = new DataTexture(colourMap, COLOURS, 1, RGBAFormat);
    colours.needsUpdate = true;
    this.material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      side: 2,
      uniforms: {
        depths: { value: null },
        colours: { value: colours },
        grid: { value: [1, 1] },
        spacingMm: { value: 1 },
        viewpoint: { value: [0, 0, 0] },
        exaggeration: { value: 3 },
        fromMm: { value: 0 },
        toMm: { value: 1.5 },
      },
    });
    this.space = new Space(host, "The surface in space; drag to turn, wheel to come closer");
    const full = el("span", {}, "Depth");
    host.append(el("label", { class: "row corner exaggeration" }, full, this.scale, this.reported));
    this.scale.addEventListener("input", () => {
      const times = Number(this.scale.value);
      say(this.reported, times === 1 ? "true scale" : `${times} ×`);
      this.uniform("exaggeration", times);
      this.space.render();
    });
  }

  show(depth: DepthMap, range: Range): void {
    const every = Math.max(1, Math.ceil(Math.max(depth.width, depth.height) / this.finest));
    const [columns, rows] = [Math.floor(depth.width / every), Math.floor(depth.height / every)];
    this.reshape(columns, rows, every);
    const { values } = this;
    const mmPerUnit = depth.umPerUnit / 1000;
    let at = 0;
    for (let row = 0; row < rows; ++row) {
      let from = row * every * depth.width;
      for (let column = 0; column < columns; ++column, from += every) {
        const value = depth.values[from] as number;
        values[at++] = value === depth.untrusted ? -100 : value * mmPerUnit;
      }
    }
    if (this.texture) this.texture.needsUpdate = true;
    this.uniform("spacingMm", depth.mmPerPx * every);
    const { footXMm, footYMm, perMm } = depth.viewpoint;
    this.uniform("viewpoint", [footXMm, footYMm, perMm]);
    this.uniform("fromMm", range.fromMm);
    this.uniform("toMm", range.toMm);
    this.space.render();
    // A coarser mesh where pictures take too long, for good: a changing one would flicker.
    if (++this.pictures % JUDGED_EVERY === 0 && this.space.renderMs() > SLOW_MS) {
      this.finest = Math.max(COARSEST, this.finest / 2);
    }
  }

  close(): void {
    this.space.close();
  }

  private uniform(name: string, value: unknown): void {
    const uniform = this.material.uniforms[name];
    if (uniform) uniform.value = value;
  }

  private reshape(columns: number, rows: number, every: number): void {
    const shape = `${columns} ${rows} ${every}`;
    if (shape === this.shape) return;
    this.shape = shape;
    this.host.dataset["every"] = String(every);
    this.texture?.dispose();
    this.mesh?.geometry.dispose();
    if (this.mesh) this.space.scene.remove(this.mesh);
    this.values = new Float32Array(columns * rows);
    this.texture = new DataTexture(this.values, columns, rows, RedFormat, FloatType);
    this.texture.magFilter = this.texture.minFilter = NearestFilter;
    this.texture.wrapS = this.texture.wrapT = ClampToEdgeWrapping;
    this.texture.unpackAlignment = 1;
    this.uniform("depths", this.texture);
    this.uniform("grid", [columns, rows]);
    this.mesh = new Mesh(gridGeometry(columns, rows), this.material);
    // Its true extent is the shader's to know.
    this.mesh.frustumCulled = false;
    this.mesh.geometry.boundingSphere = new Sphere(new Vector3(), 100);
    this.space.scene.add(this.mesh);
  }
}
