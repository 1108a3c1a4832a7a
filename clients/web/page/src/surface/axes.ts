// The axes of the object in contact, in the scene of its points.
import { Vector3 } from "three";
import type { Object3D } from "three";
import type { ObjectPose } from "../../gen/dtact_pb";

/** A vector of the surface frame as the scene has it. */
function toScene(vector: { x: number; y: number; z: number } | undefined): Vector3 {
  return vector ? new Vector3(vector.x, -vector.y, -vector.z) : new Vector3();
}

/** Shows the axes where the object is now; hides them while the pose is not known. */
export function placeAxes(
  axes: Pick<Object3D, "visible" | "position" | "quaternion">,
  pose: ObjectPose | undefined,
): void {
  const known = pose !== undefined && pose.valid;
  axes.visible = known;
  if (!known) return;
  // The centre is that of the present contact: it has moved with the object already.
  axes.position.copy(toScene(pose.centreMm));
  const turn = toScene(pose.rotationDeg).multiplyScalar(Math.PI / 180);
  const angle = turn.length();
  axes.quaternion.identity();
  if (angle > 0) axes.quaternion.setFromAxisAngle(turn.divideScalar(angle), angle);
}
