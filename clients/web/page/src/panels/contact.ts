// What touches, in numbers.
import { Facts, panel } from "../dom";
import type { Frame } from "../session/messages";
import { absence, fixed, mm } from "../words";

export class ContactPanel {
  private readonly facts = new Facts({
    touching: { label: "State" },
    deepest: { label: "× Deepest", hint: "Indentation along the surface's normal" },
    area: { label: "Area", hint: "Pressed deeper than the daemon's contact threshold" },
    volume: { label: "Volume" },
    centroid: { label: "○ Centroid", hint: "Weighted by depth; x to the right, y down, from the map's centre" },
    force: { label: "Force", hint: "Along the surface's normal; needs a calibration by dtact-calibrate force" },
  });
  readonly element = panel("Contact", this.facts.element);

  show(frame: Frame): void {
    const contact = frame.contact;
    const touching = contact?.touching === true;
    this.facts.set("touching", contact ? (touching ? "touching" : "nothing touches") : absence(frame.contactAbsence));
    this.facts.set("deepest", touching ? mm(contact.deepestMm, 3) : "–");
    this.facts.set("area", touching ? `${fixed(contact.areaMm2, 1)} mm²` : "–");
    this.facts.set("volume", touching ? `${fixed(contact.volumeMm3, 2)} mm³` : "–");
    this.facts.set("centroid", touching ? `${fixed(contact.xMm, 2)}, ${mm(contact.yMm)}` : "–");
    this.facts.set("force", this.force(frame));
  }

  private force(frame: Frame): string {
    const contact = frame.contact;
    if (!contact) return "–";
    if (contact.forceN === undefined) return "not calibrated";
    const worth = contact.forceUncertaintyN;
    return `${fixed(contact.forceN, 3)} N${worth === undefined ? "" : ` ± ${fixed(worth, 3)}`}`;
  }
}
