// Draws a map of depth in the locked range's colours, or the camera's grey picture: one pixel of the
// canvas for one of the map, coloured on the graphics card.
import type { DepthMap, LumaMap } from "../session/messages";
import { BEYOND, colourMap, COLOURS } from "./colour_map";

export interface Range {
  fromMm: number;
  toMm: number;
}

const VERTEX = `#version 300 es
void main() {
  // One triangle that covers everything.
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

const DEPTH_FRAGMENT = `#version 300 es
precision highp float;
precision highp int;
precision highp isampler2D;
uniform isampler2D depth;
uniform sampler2D colours;
uniform ivec2 size;
uniform int untrusted;
uniform float mmPerUnit;
uniform float fromMm;
uniform float toMm;
uniform float outlineMm;
uniform vec3 beyond;
out vec4 colour;

float mmAt(ivec2 at) {
  int value = texelFetch(depth, clamp(at, ivec2(0), size - 1), 0).r;
  return value == untrusted ? 1e3 : float(value) * mmPerUnit;
}

void main() {
  ivec2 at = ivec2(int(gl_FragCoord.x), size.y - 1 - int(gl_FragCoord.y));
  int value = texelFetch(depth, at, 0).r;
  if (value == untrusted) {
    // Stripes, which no depth has.
    colour = vec4(vec3(((at.x + at.y) / 4) % 2 == 0 ? 0.42 : 0.56), 1.0);
    return;
  }
  float mm = float(value) * mmPerUnit;
  if (outlineMm > 0.0 && mm >= outlineMm) {
    float around = min(min(mmAt(at + ivec2(1, 0)), mmAt(at - ivec2(1, 0))),
                       min(mmAt(at + ivec2(0, 1)), mmAt(at - ivec2(0, 1))));
    if (around < outlineMm) {
      colour = vec4(1.0);
      return;
    }
  }
  if (mm > toMm) {
    colour = vec4(beyond, 1.0);
    return;
  }
  int step = int(floor((mm - fromMm) / (toMm - fromMm) * ${COLOURS}.0));
  colour = texelFetch(colours, ivec2(clamp(step, 0, ${COLOURS - 1}), 0), 0);
}`;

const LUMA_FRAGMENT = `#version 300 es
precision highp float;
uniform sampler2D luma;
uniform ivec2 size;
out vec4 colour;
void main() {
  ivec2 at = ivec2(int(gl_FragCoord.x), size.y - 1 - int(gl_FragCoord.y));
  colour = vec4(vec3(texelFetch(luma, at, 0).r), 1.0);
}`;

class Program {
  private readonly program: WebGLProgram;
  private readonly places = new Map<string, WebGLUniformLocation | null>();

  constructor(
    private readonly gl: WebGL2RenderingContext,
    fragment: string,
  ) {
    this.program = gl.createProgram() as WebGLProgram;
    for (const [type, source] of [
      [gl.VERTEX_SHADER, VERTEX],
      [gl.FRAGMENT_SHADER, fragment],
    ] as const) {
      const shader = gl.createShader(type) as WebGLShader;
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
    }
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(`the shader was refused: ${gl.getProgramInfoLog(this.program)}`);
    }
  }

  use(): void {
    this.gl.useProgram(this.program);
  }

  at(name: string): WebGLUniformLocation | null {
    let place = this.places.get(name);
    if (place === undefined) {
      place = this.gl.getUniformLocation(this.program, name);
      this.places.set(name, place);
    }
    return place;
  }
}

/** A texture of one value a pixel, made anew when the size changes. */
class MapTexture {
  private readonly texture: WebGLTexture;
  width = 0;
  height = 0;

  constructor(
    private readonly gl: WebGL2RenderingContext,
    private readonly internal: number,
    private readonly format: number,
    private readonly type: number,
  ) {
    this.texture = gl.createTexture() as WebGLTexture;
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    for (const key of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
      gl.texParameteri(gl.TEXTURE_2D, key, gl.NEAREST);
    }
  }

  bind(unit: number): void {
    this.gl.activeTexture(this.gl.TEXTURE0 + unit);
    this.gl.bindTexture(this.gl.TEXTURE_2D, this.texture);
  }

  fill(values: ArrayBufferView, width: number, height: number): void {
    const gl = this.gl;
    this.bind(0);
    // Rows of an odd number of bytes follow each other without a gap.
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    if (width === this.width && height === this.height) {
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, this.format, this.type, values);
    } else {
      gl.texImage2D(
        gl.TEXTURE_2D,
        0,
        this.internal,
        width,
        height,
        0,
        this.format,
        this.type,
        values,
      );
      this.width = width;
      this.height = height;
    }
  }
}

interface Graphics {
  gl: WebGL2RenderingContext;
  depthProgram: Program;
  lumaProgram: Program;
  depth: MapTexture;
  luma: MapTexture;
  colours: MapTexture;
}

function prepare(gl: WebGL2RenderingContext): Graphics {
  const colours = new MapTexture(gl, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE);
  colours.fill(colourMap, COLOURS, 1);
  return {
    gl,
    depthProgram: new Program(gl, DEPTH_FRAGMENT),
    lumaProgram: new Program(gl, LUMA_FRAGMENT),
    depth: new MapTexture(gl, gl.R16I, gl.RED_INTEGER, gl.SHORT),
    luma: new MapTexture(gl, gl.R8, gl.RED, gl.UNSIGNED_BYTE),
    colours,
  };
}

export class MapCanvas {
  private graphics: Graphics | undefined;
  private last: { depth: DepthMap } | { luma: LumaMap } | undefined;
  range: Range = { fromMm: 0, toMm: 1.5 };
  /** Where the depth crosses this a line is drawn, millimetres; 0: none. */
  outlineMm = 0.1;

  /** Throws where the browser has no WebGL 2; the sentence says what to do. */
  constructor(readonly canvas: HTMLCanvasElement) {
    // Kept after drawing, so that a picture can be taken of it at any time.
    const gl = canvas.getContext("webgl2", {
      alpha: false,
      antialias: false,
      preserveDrawingBuffer: true,
    });
    if (!gl) {
      throw new Error(
        "This browser offers no WebGL 2, in which depth is drawn. Switch on hardware " +
          "acceleration, or take a current Chromium, Firefox or Safari.",
      );
    }
    this.graphics = prepare(gl);
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.graphics = undefined;
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this.graphics = prepare(gl);
      this.refill();
    });
  }

  drawDepth(depth: DepthMap): void {
    this.last = { depth };
    this.graphics?.depth.fill(depth.values, depth.width, depth.height);
    this.paintDepth(depth);
  }

  drawLuma(luma: LumaMap): void {
    this.last = { luma };
    this.graphics?.luma.fill(luma.values, luma.width, luma.height);
    this.paintLuma(luma);
  }

  /** With another range or outline; a map's memory may have gone back to the worker by then. */
  redraw(): void {
    if (!this.last || !this.graphics) return;
    if ("depth" in this.last) this.paintDepth(this.last.depth);
    else this.paintLuma(this.last.luma);
  }

  /** Draws the last map into new textures, unless its memory has gone back to the worker. */
  private refill(): void {
    if (!this.last) return;
    if ("depth" in this.last) {
      if (this.last.depth.values.length > 0) this.drawDepth(this.last.depth);
    } else if (this.last.luma.values.length > 0) {
      this.drawLuma(this.last.luma);
    }
  }

  private resize(width: number, height: number): void {
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    this.graphics?.gl.viewport(0, 0, width, height);
  }

  private paintDepth(depth: DepthMap): void {
    if (!this.graphics) return;
    const { gl, depthProgram: program } = this.graphics;
    this.resize(depth.width, depth.height);
    program.use();
    this.graphics.depth.bind(0);
    this.graphics.colours.bind(1);
    gl.uniform1i(program.at("depth"), 0);
    gl.uniform1i(program.at("colours"), 1);
    gl.uniform2i(program.at("size"), depth.width, depth.height);
    gl.uniform1i(program.at("untrusted"), depth.untrusted);
    gl.uniform1f(program.at("mmPerUnit"), depth.umPerUnit / 1000);
    gl.uniform1f(program.at("fromMm"), this.range.fromMm);
    gl.uniform1f(program.at("toMm"), this.range.toMm);
    gl.uniform1f(program.at("outlineMm"), this.outlineMm);
    gl.uniform3f(program.at("beyond"), BEYOND[0] / 255, BEYOND[1] / 255, BEYOND[2] / 255);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  private paintLuma(luma: LumaMap): void {
    if (!this.graphics) return;
    const { gl, lumaProgram: program } = this.graphics;
    this.resize(luma.width, luma.height);
    program.use();
    this.graphics.luma.bind(0);
    gl.uniform1i(program.at("luma"), 0);
    gl.uniform2i(program.at("size"), luma.width, luma.height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}
