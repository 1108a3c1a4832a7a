// Position of the axes of the object in contact on the page. PAGE_NODE as in decoders_test.mjs.
import assert from "node:assert/strict";
import path from "node:path";
import test from "node:test";

const { placeAxes } = await import(path.resolve(process.env.PAGE_NODE, "axes.mjs"));

/** Axes that keep what they are given. */
function axes() {
  const kept = { visible: false, at: undefined, turn: undefined };
  kept.position = { copy: ({ x, y, z }) => (kept.at = [x, y, z]) };
  kept.quaternion = {
    identity: () => (kept.turn = undefined),
    setFromAxisAngle: ({ x, y, z }, angle) => (kept.turn = [x, y, z, angle]),
  };
  return kept;
}

// centreMm is the centre after the motion: moving it again would draw the axes off
// the object.
test("the axes are at the pose's centre, turned as the object", () => {
  const shown = axes();
  placeAxes(shown, {
    valid: true,
    centreMm: { x: 4, y: -2, z: 1 },
    translationMm: { x: 0.5, y: 3, z: 0 },
    rotationDeg: { x: 0, y: 0, z: 90 },
  });
  assert.equal(shown.visible, true);
  // The scene's y and z are the surface frame's, reversed.
  assert.deepEqual(shown.at, [4, 2, -1]);
  assert.deepEqual(shown.turn.map((value) => Math.round(value * 1e6) / 1e6 + 0), [0, 0, -1, 1.570796]);
});

test("axes are hidden without a pose and while it is lost", () => {
  const shown = axes();
  for (const pose of [undefined, { valid: false }]) {
    shown.visible = true;
    placeAxes(shown, pose);
    assert.equal(shown.visible, false);
  }
});
