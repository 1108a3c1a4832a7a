// From the wire's Frame to what the page shows of it.
import type {
  DepthMap as WireDepth,
  Frame as WireFrame,
  LumaMap as WireLuma,
  PointCloud as WireCloud,
  Surface as WireSurface,
} from "../../gen/dtact_pb";
import { CloudEncoding, LumaEncoding } from "../../gen/dtact_pb";
import { decodeDepth, MAX_VALUES } from "../wire/depth";
import type { Cloud, DepthMap, Frame, LumaMap } from "./messages";

/** Memory that the page has given back, for the next maps of the same size. */
export class Spare {
  private depth: Int16Array[] = [];
  private luma: Uint8Array[] = [];

  give(depth: Int16Array | undefined, luma: Uint8Array | undefined): void {
    if (depth && this.depth.length < 3) this.depth.push(depth);
    if (luma && this.luma.length < 3) this.luma.push(luma);
  }

  takeDepth(length: number): Int16Array {
    this.depth = this.depth.filter((spare) => spare.length === length);
    return this.depth.pop() ?? new Int16Array(length);
  }

  takeLuma(length: number): Uint8Array {
    this.luma = this.luma.filter((spare) => spare.length === length);
    return this.luma.pop() ?? new Uint8Array(length);
  }
}

function unpackDepth(map: WireDepth, surface: WireSurface | undefined, spare: Spare): DepthMap {
  const length = map.width * map.height;
  if (length > MAX_VALUES) throw new Error(`a depth map of ${map.width} x ${map.height}`);
  const values = spare.takeDepth(length);
  decodeDepth(map.encoding, map.data, map.width, map.height, values);
  return {
    values,
    width: map.width,
    height: map.height,
    mmPerPx: map.mmPerPx,
    viewpoint: {
      footXMm: surface?.footXMm ?? 0,
      footYMm: surface?.footYMm ?? 0,
      perMm: surface?.perMm ?? 0,
    },
    umPerUnit: map.umPerUnit,
    untrusted: map.untrustedValue,
    uncertaintyUm: map.uncertaintyUm,
    decimation: map.decimation,
    sharpenSteps: map.sharpenSteps,
  };
}

function unpackLuma(map: WireLuma, spare: Spare): LumaMap {
  if (map.encoding !== LumaEncoding.LUMA_GREY8 || map.data.length !== map.width * map.height) {
    throw new Error(`a luma map of ${map.width} x ${map.height} in ${map.data.length} bytes`);
  }
  const values = spare.takeLuma(map.data.length);
  values.set(map.data);
  return { values, width: map.width, height: map.height };
}

/** x, y, z and the normal's. */
const CLOUD_PARTS = 6;

function unpackCloud(cloud: WireCloud): Cloud {
  const { width, height, data } = cloud;
  const bytes = CLOUD_PARTS * width * height * Int16Array.BYTES_PER_ELEMENT;
  const known = cloud.encoding === CloudEncoding.CLOUD_INT16;
  if (!known || width * height > MAX_VALUES || data.length !== bytes) {
    throw new Error(`a cloud of ${width} x ${height} in ${data.length} bytes`);
  }
  // Where it lies in the message is no place for 16-bit numbers.
  const values = new Int16Array(data.slice().buffer);
  return { values, width, height, mmPerUnit: 1000 * cloud.metresPerUnit, points: cloud.points };
}

/** RMS of every 17th pixel that is trusted, micrometres; undefined if there is none. */
function rootMeanSquareUm(map: DepthMap): number | undefined {
  let sum = 0;
  let count = 0;
  // An odd distance walks through all columns.
  for (let at = 0; at < map.values.length; at += 17) {
    const value = map.values[at] as number;
    if (value === map.untrusted) continue;
    sum += value * value;
    ++count;
  }
  return count > 0 ? Math.sqrt(sum / count) * map.umPerUnit : undefined;
}

/** Throws where a map is broken. */
export function unpack(
  frame: WireFrame,
  spare: Spare,
  capturedMs: number | undefined,
  dropped: number,
  behind: number | undefined,
): Frame {
  const depth = frame.depth && unpackDepth(frame.depth, frame.surface, spare);
  const noContact = frame.contact?.inContact === false;
  return {
    sequence: Number(frame.sequence),
    wallMs: Number(frame.wallNs / 1000n) / 1000,
    capturedMs,
    health: frame.health,
    contact: frame.contact,
    contactAbsence: frame.contactAbsence,
    light: frame.light,
    calibration: frame.calibration === undefined ? undefined : Number(frame.calibration),
    depth,
    luma: frame.luma && unpackLuma(frame.luma, spare),
    pose: frame.pose,
    recognition: frame.recognition,
    cloud: frame.cloud && unpackCloud(frame.cloud),
    madeMs: frame.times
      ? (frame.times.rectifyNs + frame.times.smoothNs + frame.times.lutNs) / 1e6
      : 0,
    madeDecimation: frame.depth?.madeDecimation || frame.depth?.decimation || 1,
    noContactRmsUm: noContact && depth ? rootMeanSquareUm(depth) : undefined,
    dropped,
    behind,
  };
}
