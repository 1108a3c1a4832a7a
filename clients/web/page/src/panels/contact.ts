// The contact in numbers.
import { ObjectPose_Tracking, Recognition_Verdict } from "../../gen/dtact_pb";
import type { ObjectPose, Recognition, Vector3 } from "../../gen/dtact_pb";
import { el, Facts, panel, say } from "../dom";
import type { Frame } from "../session/messages";
import { absence, fixed, forceAbsence, mm } from "../labels";

const TRACKING: Record<number, string> = {
  [ObjectPose_Tracking.STARTED]: "from here",
  [ObjectPose_Tracking.LOST]: "lost",
  [ObjectPose_Tracking.RECOVERED]: "found again",
  [ObjectPose_Tracking.SEARCHING]: "searching",
};

/** Motion since contact began, or the pose of a known object, from dtact-perceive. */
function motion(pose: ObjectPose | undefined): { moved: string; turned: string } {
  if (!pose) return { moved: "–", turned: "–" };
  const reported = (vector: Vector3 | undefined, digits: number): string =>
    vector ? [vector.x, vector.y, vector.z].map((part) => fixed(part, digits)).join(", ") : "–";
  const how = TRACKING[pose.tracking];
  if (pose.tracking === ObjectPose_Tracking.SEARCHING) {
    return { moved: `${pose.object}: ${how}`, turned: "–" };
  }
  const unobservable = pose.unobservable.length;
  return {
    moved: `${reported(pose.translationMm, 2)} mm${how ? `, ${how}` : ""}`,
    turned: `${reported(pose.rotationDeg, 1)}°${unobservable > 0 ? `, ${unobservable} unobservable` : ""}`,
  };
}

/** What the object is, in a word or two. */
function verdict(recognition: Recognition): string {
  switch (recognition.verdict) {
    case Recognition_Verdict.KNOWN:
      return recognition.candidates[0]?.name ?? "–";
    case Recognition_Verdict.UNKNOWN:
      return "unknown object";
    case Recognition_Verdict.TOO_SHALLOW:
      return "press deeper";
    case Recognition_Verdict.CUT_OFF:
      return "press nearer to the middle";
    default:
      return "unsure: press again";
  }
}

/** The object's name and the most probable candidates as bars, from dtact-perceive. */
class ObjectView {
  private readonly name = el("strong");
  private readonly bars = [0, 1, 2].map(() => ({
    label: el("span"),
    meter: el("meter", { min: "0", max: "1" }),
  }));
  readonly element = el(
    "div",
    { class: "object", hidden: "" },
    this.name,
    ...this.bars.map(({ label, meter }) => el("label", {}, label, meter)),
  );

  show(recognition: Recognition | undefined): void {
    if (recognition) this.element.hidden = false;
    say(this.name, recognition ? verdict(recognition) : "–");
    this.bars.forEach(({ label, meter }, index) => {
      const candidate = recognition?.candidates[index];
      const share = candidate?.probability ?? 0;
      say(label, candidate ? `${candidate.name} ${fixed(100 * share, 0)} %` : "–");
      meter.value = share;
    });
  }
}

export class ContactPanel {
  private readonly object = new ObjectView();
  private readonly motion = new Facts({
    moved: { label: "Moved", hint: "Since the contact was made: x, y, z of the surface frame" },
    turned: {
      label: "Turned",
      hint: "Axis times angle; directions that the shape does not show are unobservable",
    },
  });
  private readonly facts = new Facts({
    inContact: { label: "State" },
    deepest: { label: "× Deepest", hint: "Indentation along the surface's normal" },
    area: { label: "Area", hint: "Pressed deeper than the daemon's contact threshold" },
    volume: { label: "Volume" },
    centroid: {
      label: "○ Centroid",
      hint: "Weighted by depth; x to the right, y down, from the map's centre",
    },
    force: {
      label: "Force",
      hint: "Along the surface's normal; needs a calibration by dtact-calibrate force",
    },
  });
  readonly element = panel(
    "Contact",
    this.object.element,
    this.facts.element,
    this.motion.element,
  );

  constructor() {
    this.hideMotion();
  }

  /** For a sensor without motion and recognition of the object in contact. */
  hideMotion(): void {
    this.motion.element.hidden = true;
    this.object.element.hidden = true;
  }

  show(frame: Frame): void {
    if (frame.pose) this.motion.element.hidden = false;
    this.object.show(frame.recognition);
    const { moved, turned } = motion(frame.pose);
    this.motion.set("moved", moved);
    this.motion.set("turned", turned);
    const contact = frame.contact;
    const inContact = contact?.inContact === true;
    this.facts.set(
      "inContact",
      contact ? (inContact ? "in contact" : "no contact") : absence(frame.contactAbsence),
    );
    this.facts.set("deepest", inContact ? mm(contact.deepestMm, 3) : "–");
    this.facts.set("area", inContact ? `${fixed(contact.areaMm2, 1)} mm²` : "–");
    this.facts.set("volume", inContact ? `${fixed(contact.volumeMm3, 2)} mm³` : "–");
    this.facts.set("centroid", inContact ? `${fixed(contact.xMm, 2)}, ${mm(contact.yMm)}` : "–");
    this.facts.set("force", this.force(frame));
  }

  private force(frame: Frame): string {
    const contact = frame.contact;
    if (!contact) return "–";
    if (contact.forceN === undefined) return forceAbsence(contact.forceAbsence);
    const worth = contact.forceUncertaintyN;
    return `${fixed(contact.forceN, 3)} N${worth === undefined ? "" : ` ± ${fixed(worth, 3)}`}`;
  }
}
