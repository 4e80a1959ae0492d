// Sliders that move the cameras from their places in the plan.

import { element } from "/page/elements.js";
import { fixed } from "/page/geometry.js";

const byId = (id) => document.getElementById(id);

const CAMERAS = ["left", "right"];

// Where a slider's value goes: the key of a move, and the place in it.
const SLIDERS = [
  { label: "x", unit: " mm", key: "shift_mm", at: 0, most: 400, step: 5 },
  { label: "y", unit: " mm", key: "shift_mm", at: 1, most: 400, step: 5 },
  { label: "z", unit: " mm", key: "shift_mm", at: 2, most: 400, step: 5 },
  { label: "Pan", unit: "°", key: "turn_deg", at: 2, most: 60, step: 0.5 },
  { label: "Tilt", unit: "°", key: "turn_deg", at: 1, most: 60, step: 0.5 },
  { label: "Roll", unit: "°", key: "turn_deg", at: 0, most: 180, step: 1 },
];

const still = () => ({ shift_mm: [0, 0, 0], turn_deg: [0, 0, 0] });

export class CameraForm {
  // Calls `changed` when a camera has moved.
  constructor(changed) {
    this.values = CAMERAS.map(still);
    this.inputs = [];
    byId("cameras-form").append(...CAMERAS.map((name, camera) => this.camera(name, camera, changed)));
    byId("cameras-back").addEventListener("click", () => {
      this.values = CAMERAS.map(still);
      this.inputs.forEach((show) => show());
      byId("cameras-back").disabled = true;
      changed();
    });
  }

  camera(name, camera, changed) {
    const details = element("details");
    details.open = true;
    const sliders = SLIDERS.map((slider, index) => this.slider(`camera-${name}-${index}`, slider, camera, name, changed));
    details.append(element("summary", `${name === "left" ? "Left" : "Right"} camera, moved by`), ...sliders);
    return details;
  }

  slider(id, { label, unit, key, at, most, step }, camera, name, changed) {
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
      show();
      byId("cameras-back").disabled = !this.moves();
      changed();
    });
    this.inputs.push(show);
    row.append(text, input);
    show();
    return row;
  }

  // Of both cameras; nothing while both are where the plan has them.
  moves() {
    const moved = this.values.some(({ shift_mm, turn_deg }) => [...shift_mm, ...turn_deg].some((value) => value !== 0));
    return moved ? this.values : undefined;
  }
}
