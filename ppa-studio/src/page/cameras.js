// Sliders and handles in the room that move the cameras from their places in the plan.

import { element } from "/page/elements.js";
import { add, fixed, inverse, rotate, sub, transform, rotatedAbout } from "/page/geometry.js";

const byId = (id) => document.getElementById(id);

const CAMERAS = ["left", "right"];

// Destination of a slider's value: the key of a move, and the index in it.
const SLIDERS = [
  { label: "x", unit: " mm", key: "shift_mm", at: 0, most: 400, step: 5 },
  { label: "y", unit: " mm", key: "shift_mm", at: 1, most: 400, step: 5 },
  { label: "z", unit: " mm", key: "shift_mm", at: 2, most: 400, step: 5 },
  { label: "Pan", unit: "°", key: "turn_deg", at: 2, most: 60, step: 0.5 },
  { label: "Tilt", unit: "°", key: "turn_deg", at: 1, most: 60, step: 0.5 },
  { label: "Roll", unit: "°", key: "turn_deg", at: 0, most: 180, step: 1 },
];

// Distance from a camera to its aim point: nearer than the limb, at which both cameras look.
const AIM_MM = 600;

// Aim point of a camera.
export const aim = ({ room_from_camera }) => transform(room_from_camera, [0, 0, AIM_MM]);

const still = () => ({ shift_mm: [0, 0, 0], turn_deg: [0, 0, 0] });

export class CameraForm {
  // Calls `changed` when a camera has moved.
  constructor(changed) {
    this.values = CAMERAS.map(still);
    this.changed = changed;
    this.inputs = [];
    byId("cameras-form").append(...CAMERAS.map((name, camera) => this.camera(name, camera)));
    byId("cameras-back").addEventListener("click", () => {
      this.values = CAMERAS.map(still);
      this.moved();
    });
  }

  moved() {
    this.inputs.forEach((show) => show());
    byId("cameras-back").disabled = !this.moves();
    this.changed();
  }

  camera(name, camera) {
    const details = element("details");
    details.open = true;
    const sliders = SLIDERS.map((slider, index) => this.slider(`camera-${name}-${index}`, slider, camera, name));
    details.append(element("summary", `${name === "left" ? "Left" : "Right"} camera, moved by`), ...sliders);
    return details;
  }

  slider(id, { label, unit, key, at, most, step }, camera, name) {
    const row = element("div", "", { class: "row" });
    const input = element("input", "", { type: "range", id, min: -most, max: most, step, "aria-label": `${label} of the ${name} camera` });
    const text = element("label", "", { for: id });
    const show = () => {
      const value = this.values[camera][key][at];
      input.value = value;
      text.textContent = `${label} ${fixed(value, step < 1 ? 1 : 0)}${unit}`;
    };
    input.addEventListener("input", () => {
      this.values[camera][key][at] = Number(input.value);
      this.moved();
    });
    this.inputs.push(show);
    row.append(text, input);
    show();
    return row;
  }

  // Returns the moves of both cameras; undefined if both are at their places in the plan.
  moves() {
    const moved = this.values.some(({ shift_mm, turn_deg }) => [...shift_mm, ...turn_deg].some((value) => value !== 0));
    return moved ? structuredClone(this.values) : undefined;
  }

  // Returns the handles that are dragged across the line of sight: the camera, which shifts it, and its aim point, which pans and
  // tilts it. `room` was computed with the moves `made`.
  handles(room, made) {
    const ctFromRoom = inverse(room.room_from_ct);
    return room.cameras.flatMap((camera, i) => {
      const from = made?.[i] ?? still();
      const handle = (at, change) => {
        const move = (place) => {
          this.values[i] = place ? { ...from, ...change(transform(room.room_from_ct, place)) } : from;
          this.moved();
        };
        return { at: transform(ctFromRoom, at), onSkin: false, move, drop: move };
      };
      return [
        handle(camera.centre, (place) => shifted(from, rotate(inverse(room.room_from_device), sub(place, camera.centre)))),
        handle(aim(camera), (place) => aimed(from, transform(inverse(camera.room_from_camera), place))),
      ];
    });
  }
}

// Returns the shift of a camera after a move by `by` mm along the axes of the device.
function shifted({ shift_mm }, by) {
  return { shift_mm: add(shift_mm, by).map(Math.round) };
}

// Returns the rotations that aim a camera at a place in its frame; the roll stays.
function aimed({ turn_deg }, place) {
  const [roll, tilt, pan] = turn_deg;
  const [x, y, z] = rotatedAbout(rotatedAbout(rotatedAbout(place, 2, roll), 0, tilt), 1, pan);
  const degrees = (radians) => Math.round(10 * radians * 180 / Math.PI) / 10;
  return { turn_deg: [roll, degrees(Math.atan2(-y, Math.hypot(x, z))), degrees(Math.atan2(x, z))] };
}
