// Numbers and the wire's enums, in words.
import { ContactAbsence, ForceAbsence, Health, State } from "../gen/dtact_pb";

const MINUS = "−";

export function fixed(value: number, digits: number): string {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", MINUS);
}

export function mm(value: number, digits = 2): string {
  return `${fixed(value, digits)} mm`;
}

export function um(value: number): string {
  return `${fixed(value, 0)} µm`;
}

export function signedPercent(share: number): string {
  const text = fixed(100 * share, 2);
  return `${share > 0 ? "+" : ""}${text} %`;
}

export function span(seconds: number): string {
  if (seconds < 90) return `${fixed(seconds, 0)} s`;
  if (seconds < 5400) return `${Math.floor(seconds / 60)} min ${Math.floor(seconds % 60)} s`;
  return `${Math.floor(seconds / 3600)} h ${Math.floor((seconds % 3600) / 60)} min`;
}

function plain(name: string | undefined, value: number): string {
  return name ? name.toLowerCase().replaceAll("_", " ") : `unknown (${value})`;
}

export const healthName = (health: Health): string => plain(Health[health], health);
export const stateName = (state: State): string => plain(State[state], state);

export function absence(why: ContactAbsence): string {
  switch (why) {
    case ContactAbsence.UNCALIBRATED:
      return "not measured: no calibration";
    case ContactAbsence.REFERENCING:
      return "not measured: the light settles, or the reference image is being taken";
    case ContactAbsence.UNASKED:
      return "not measured yet";
    default:
      return "not measured";
  }
}

export function forceAbsence(why: ForceAbsence): string {
  switch (why) {
    case ForceAbsence.BEYOND_CALIBRATION:
      return "not known: pressed deeper than calibrated";
    case ForceAbsence.CUT_OFF:
      return "not known: the contact reaches the map's edge or untrusted pixels";
    default:
      return "not calibrated";
  }
}
