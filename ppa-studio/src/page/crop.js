// Crop of the scan: a box of voxels with edges to drag and input fields.

import { element } from "/page/elements.js";

const byId = (id) => document.getElementById(id);

const COLOUR = "#ffb454";
// Distance within which the pointer grabs an edge, CSS pixels.
const GRAB_PX = 9;

const whole = ({ size }) => ({ low: [0, 0, 0], high: [...size] });

// Returns the box of the case, initially the entire scan; null if there is no crop.
export function box(store) {
  if (store.doc.crop) return store.doc.crop;
  return store.cropping ? whole(store.doc.grid) : null;
}

// Returns the crop of the case: null for the entire scan.
export function cropOf({ grid }, shown) {
  return JSON.stringify(shown) === JSON.stringify(whole(grid)) ? null : shown;
}

// Returns the edges of a box in a slice, CSS pixels: [left or right, ...] and [upper or lower, ...], low end first.
function edges(view, { low, high }, l) {
  const corner = (end) => view.toCanvas([end[view.column] - 0.5, end[view.row] - 0.5], l);
  const [[x0, y0], [x1, y1]] = [corner(low), corner(high)];
  return { x: [x0, x1], y: [y0, y1] };
}

export function drawCrop(context, view, shown, l) {
  const { x, y } = edges(view, shown, l);
  context.strokeStyle = COLOUR;
  context.lineWidth = 2;
  context.setLineDash([6, 3]);
  context.strokeRect(Math.min(...x), Math.min(...y), Math.abs(x[1] - x[0]), Math.abs(y[1] - y[0]));
  context.setLineDash([]);
}

// Returns the edge under the pointer: voxel axis, end, and the offset of the pointer from the edge.
export function grabCrop(view, shown, at, l) {
  const { x, y } = edges(view, shown, l);
  const within = (value, ends) => value > Math.min(...ends) - GRAB_PX && value < Math.max(...ends) + GRAB_PX;
  const near = (value, ends) => ends.findIndex((end) => Math.abs(end - value) < GRAB_PX);
  const [across, down] = [near(at[0], x), near(at[1], y)];
  if (across >= 0 && within(at[1], y)) return { cropAxis: view.column, end: ["low", "high"][across], beside: [at[0] - x[across], 0] };
  if (down >= 0 && within(at[0], x)) return { cropAxis: view.row, end: ["low", "high"][down], beside: [0, at[1] - y[down]] };
  return null;
}

// Returns the box of the case with an edge moved to before a voxel of an axis; at least one voxel is left.
export function moveCrop({ grid, crop }, { cropAxis, end }, border) {
  const { size } = grid;
  const { low, high } = crop ?? whole(grid);
  const next = { low: [...low], high: [...high] };
  if (end === "low") next.low[cropAxis] = Math.max(0, Math.min(next.high[cropAxis] - 1, border));
  else next.high[cropAxis] = Math.min(size[cropAxis], Math.max(next.low[cropAxis] + 1, border));
  return next;
}

export class CropPanel {
  // `actions.crop` takes a function that returns the box for a document, or null for the entire scan; `actions.redraw` redraws the slices.
  constructor(store, actions) {
    this.store = store;
    this.actions = actions;
    byId("crop-fields").append(...[0, 1, 2].map((axis) => this.fields(axis)));
    byId("crop-start").addEventListener("click", () => {
      store.cropping = !store.cropping;
      this.show();
      actions.redraw();
    });
    byId("crop-all").addEventListener("click", () => {
      store.cropping = false;
      if (store.doc.crop) actions.crop(null);
    });
  }

  fields(axis) {
    const row = element("div", "", { class: "pair" });
    row.append(element("span", `Voxels ${"ijk"[axis]}`));
    for (const end of ["low", "high"]) {
      const word = end === "low" ? "first" : "last";
      const input = element("input", "", { type: "number", step: 1, min: 0, id: `crop-${"ijk"[axis]}-${end}`, "aria-label": `${word} voxel ${"ijk"[axis]} that is used` });
      input.addEventListener("change", () => this.typed(axis, end, input.valueAsNumber));
      row.append(input);
    }
    return row;
  }

  // The user types the last voxel; the box ends after it.
  typed(axis, end, value) {
    // An empty field changes nothing.
    if (Number.isNaN(value)) return this.show();
    const border = Math.round(end === "low" ? value : value + 1);
    this.actions.crop((doc) => moveCrop(doc, { cropAxis: axis, end }, border));
  }

  show() {
    const { doc, cropping } = this.store;
    const { low, high } = doc.crop ?? whole(doc.grid);
    for (const axis of [0, 1, 2]) {
      byId(`crop-${"ijk"[axis]}-low`).value = low[axis];
      byId(`crop-${"ijk"[axis]}-high`).value = high[axis] - 1;
    }
    byId("crop-start").setAttribute("aria-pressed", String(cropping));
    byId("crop-all").disabled = !doc.crop;
  }
}
