// Axis, joint and plane: found and chosen landmarks.

import { button as elementButton, element } from "/page/elements.js";
import { COLOURS } from "/page/slices.js";
import { add, angleDeg, fixed, norm, planeNormal, point, scale, sub } from "/page/geometry.js";

const byId = (id) => document.getElementById(id);
const REGIONS = [["joint_region", "Region at the joint"], ["calf_region", "Region away from it"]];
const KINDS = { lower_leg: "Lower leg with an ankle", knee: "Knee", other: "Another limb: set joint, axis and plane manually; the joint found is the middle of the limb" };
const PICKS = ["distal plane point", "proximal plane point 1", "proximal plane point 2"];

export class LandmarkPanel {
  constructor(store, actions) {
    this.store = store;
    this.actions = actions;
    this.picking = null;
    // Landmarks while they are dragged in the 3D view.
    this.moving = null;
    byId("limb-choice").addEventListener("change", (event) => actions.choose({ limb: event.target.value || null }));
    byId("axis-source").addEventListener("change", (event) => actions.choose({ axis_source: event.target.value }));
    PICKS.forEach((label, corner) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = label;
      button.setAttribute("aria-pressed", "false");
      button.addEventListener("click", () => this.pick(this.picking === corner ? null : corner));
      byId("picks").append(button);
    });
    byId("joint-here").addEventListener("click", () => actions.choose({ joint_centre: actions.crosshair() }));
    PICKS.forEach((label, corner) => byId("crosshair-picks").append(elementButton(label, () => this.place(corner, actions.crosshair()))));
    for (const [key, label] of REGIONS) byId("regions").append(this.regionInputs(key, label));
  }

  regionInputs(key, label) {
    const row = document.createElement("div");
    row.className = "pair";
    const name = element("span", ` ${label}`);
    name.prepend(swatch(COLOURS[key]));
    row.append(name);
    for (const [end, word] of ["from", "to"].entries()) {
      const input = document.createElement("input");
      input.type = "number";
      input.step = "1";
      input.id = `${key}-${word}`;
      input.setAttribute("aria-label", `${label}, ${word}, mm`);
      input.addEventListener("change", () => {
        const mm = Number(input.value);
        this.actions.choose((landmarks) => ({ [key]: landmarks[key].range_mm.with(end, mm) }));
      });
      row.append(input);
    }
    return row;
  }

  pick(corner) {
    this.picking = corner;
    [...byId("picks").children].forEach((button, i) => button.setAttribute("aria-pressed", String(i === corner)));
  }

  // Handles a click on the skin. Returns whether it was for this panel.
  picked(place) {
    if (this.picking === null) return false;
    const corner = this.picking;
    this.pick(null);
    this.place(corner, place);
    return true;
  }

  place(corner, place) {
    this.actions.choose(({ plane_points }) => ({ plane_points: plane_points.with(corner, place) }));
  }

  // Returns the handles of the 3D view: points of the plane move along the skin, the joint across the line of sight.
  handles() {
    const { landmarks } = this.store.doc;
    const handle = (at, onSkin, changed) => ({
      at,
      onSkin,
      move: (place) => {
        this.moving = place && changed(place, this.store.doc.landmarks);
        this.actions.landmarks();
      },
      drop: (place) => this.actions.choose((found) => changed(place, found)),
    });
    return [
      handle(landmarks.joint_centre, false, (place) => ({ joint_centre: place })),
      ...landmarks.plane_points.map((at, corner) => handle(at, true, (place, { plane_points }) => ({ plane_points: plane_points.with(corner, place) }))),
    ];
  }

  show() {
    const { doc } = this.store;
    this.moving = null;
    const why = doc.limb === "other" && doc.note ? ` Not recognised: ${doc.note}.` : "";
    byId("limb-kind").textContent = `${KINDS[doc.limb]}.${why}`;
    byId("limb-choice").value = doc.choices.limb ?? "";
    byId("axis-source").value = doc.landmarks.axis_source;
    for (const [key] of REGIONS) {
      doc.landmarks[key].range_mm.forEach((mm, end) => { byId(`${key}-${["from", "to"][end]}`).value = fixed(mm); });
    }
    byId("landmark-table").tBodies[0].replaceChildren(...this.rows().map((row) => this.row(row)), ...this.truth());
  }

  // Table row with the known mortise of the built-in phantom.
  truth() {
    const { mortise, landmarks } = this.store.doc;
    if (!mortise) return [];
    const row = element("tr");
    const away = fixed(angleDeg(mortise, landmarks.anterior));
    row.append(head("Mortise", COLOURS.mortise), element("td", point(mortise, 3)), element("td", `truth of the phantom, ${away}° from anterior`));
    return [row];
  }

  // Returns each landmark with its value, the keys that set it, and its distance from the automatic one.
  rows() {
    const { landmarks: now, automatic } = this.store.doc;
    const away = (text) => (automatic ? text() : "");
    return [
      { name: "Joint", colour: COLOURS.joint, value: `${point(now.joint_centre)} mm`, keys: ["joint_centre"],
        away: away(() => `${fixed(norm(sub(now.joint_centre, automatic.joint_centre)))} mm`) },
      { name: "Axis", colour: COLOURS.axis, value: point(now.axis_direction, 4), keys: ["axis", "joint_region", "calf_region", "axis_source"],
        away: away(() => `${fixed(angleDeg(now.axis_direction, automatic.axis_direction), 2)}°`) },
      { name: "Anterior", colour: COLOURS.joint, value: point(now.anterior, 3), keys: ["anterior"],
        away: away(() => `${fixed(angleDeg(now.anterior, automatic.anterior), 2)}°`) },
      { name: "Plane", colour: COLOURS.plane, value: now.plane_points.map((p) => point(p)).join("\n"), keys: ["plane_points"],
        away: away(() => `${fixed(angleDeg(planeNormal(now.plane_points), planeNormal(automatic.plane_points)), 2)}°`) },
    ];
  }

  row({ name, colour, value, keys, away }) {
    const { choices } = this.store.doc;
    const chosen = keys.filter((key) => choices[key] !== undefined && choices[key] !== null);
    const row = document.createElement("tr");
    const what = document.createElement("td");
    what.textContent = value;
    const state = document.createElement("td");
    if (chosen.length === 0) {
      state.textContent = "found";
    } else {
      state.className = "chosen";
      state.textContent = `chosen, ${away} from the one found `;
      const again = document.createElement("button");
      again.type = "button";
      again.textContent = "Find again";
      again.setAttribute("aria-label", `Find again: ${name}`);
      again.addEventListener("click", () => this.actions.choose(Object.fromEntries(chosen.map((key) => [key, null]))));
      state.append(again);
    }
    row.append(head(name, colour), what, state);
    return row;
  }

  // Returns lines and points for the 3D view, ct frame.
  drawing() {
    const landmarks = { ...this.store.doc.landmarks, ...this.moving };
    const { mortise } = this.store.doc;
    const along = (s) => add(landmarks.axis_point, scale(landmarks.axis_direction, s));
    const [a, b, c] = landmarks.plane_points;
    const jointTo = (p) => add(landmarks.joint_centre, scale(p, 60));
    return {
      lines: [
        { points: [along(-300), along(300)], colour: COLOURS.axis, through: true },
        { points: [a, b, b, c, c, a], colour: COLOURS.plane, through: true },
        { points: [landmarks.joint_centre, jointTo(landmarks.anterior)], colour: COLOURS.joint, through: true },
        ...(mortise ? [{ points: [landmarks.joint_centre, jointTo(mortise)], colour: COLOURS.mortise, through: true }] : []),
      ],
      points: [
        { points: landmarks.plane_points, colour: COLOURS.plane, through: true },
        { points: [landmarks.joint_centre], colour: COLOURS.joint, through: true },
      ],
    };
  }
}

// Header cell with the name and the colour of a landmark.
function head(name, colour) {
  const made = element("th", ` ${name}`, { scope: "row" });
  made.prepend(swatch(colour));
  return made;
}

function swatch(colour) {
  const made = element("span", "", { class: "key" });
  made.style.background = colour;
  return made;
}
