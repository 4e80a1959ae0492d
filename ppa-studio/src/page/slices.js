// Slices of the scan with crosshair, landmarks and drag handles.

import { getBytes } from "/page/server.js";
import { box, drawCrop, grabCrop, moveCrop } from "/page/crop.js";
import { drawCuts } from "/page/cuts.js";
import { add, dot, inverse, scale, sub, transform } from "/page/geometry.js";

// Distance within which the pointer grabs an object, CSS pixels.
const GRAB_PX = 9;
const COLOURS = { axis: "#6cb6ff", joint: "#ff7ad9", plane: "#7ee787", joint_region: "#ffd479", calf_region: "#b8a4ff", mortise: "#f0e442", cross: "#9aa4b2" };
const LETTERS = [["R", "L"], ["A", "P"], ["F", "H"]];

export class SliceView {
  // `store` has the document, the crosshair in voxels and the window; `actions` changes them.
  constructor(figure, store, actions) {
    this.canvas = figure.querySelector("canvas");
    this.caption = figure.querySelector("figcaption");
    this.axis = Number(figure.dataset.axis);
    [this.column, this.row] = [[1, 2], [0, 2], [0, 1]][this.axis];
    this.store = store;
    this.actions = actions;
    this.planes = new Map();
    this.image = document.createElement("canvas");
    this.held = null;
    new ResizeObserver(() => this.draw()).observe(figure);
    this.canvas.addEventListener("pointerdown", (event) => this.press(event));
    this.canvas.addEventListener("pointermove", (event) => this.move(event));
    this.canvas.addEventListener("pointerup", (event) => this.release(event));
    this.canvas.addEventListener("wheel", (event) => this.turn(event), { passive: false });
    this.canvas.addEventListener("keydown", (event) => this.key(event));
  }

  // Called when the document has changed, since the mask may differ.
  forget() {
    this.planes.clear();
    this.shownIndex = null;
  }

  index() {
    return Math.round(this.store.cursor[this.axis]);
  }

  // Maps voxel axes to screen directions: the patient's right at the left, the back below or at the right, the head up.
  orient() {
    const { grid } = this.store.doc;
    const side = (voxelAxis, vertical) => {
      const direction = [0, 1, 2].map((i) => grid.ct_from_voxel[i][voxelAxis]);
      const main = direction.map(Math.abs).indexOf(Math.max(...direction.map(Math.abs)));
      let positive = direction[main] > 0;
      const letters = positive ? LETTERS[main] : [...LETTERS[main]].reverse();
      const flip = vertical && main === 2 ? positive : !positive;
      return { flip, letters: flip ? [...letters].reverse() : letters };
    };
    this.across = side(this.column, false);
    this.down = side(this.row, true);
  }

  async update() {
    if (!this.store.doc) return;
    this.orient();
    const index = this.index();
    if (!this.planes.has(index)) {
      const { size } = this.store.doc.grid;
      const count = size[this.column] * size[this.row];
      const revision = this.store.doc.revision;
      let plane;
      try {
        const bytes = await getBytes(`slice/${this.axis}/${index}`);
        plane = { hu: new Int16Array(bytes, 0, count), inside: new Uint8Array(bytes, 2 * count, count) };
      } catch (error) {
        return this.actions.fail(error);
      }
      if (revision !== this.store.doc.revision) return;
      // A cache of a few slices around the crosshair is enough.
      if (this.planes.size > 40) this.planes.clear();
      this.planes.set(index, plane);
    }
    if (index === this.index()) this.draw();
  }

  // Layout of the slice on the canvas: offset and voxel size in CSS pixels.
  layout() {
    const { size, spacing_mm } = this.store.doc.grid;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const [columns, rows] = [size[this.column], size[this.row]];
    const [dx, dy] = [spacing_mm[this.column], spacing_mm[this.row]];
    const zoom = Math.min(width / (columns * dx), height / (rows * dy)) * 0.97;
    const [w, h] = [columns * dx * zoom, rows * dy * zoom];
    return { columns, rows, x: (width - w) / 2, y: (height - h) / 2, w, h, stepX: dx * zoom, stepY: dy * zoom };
  }

  // Conversion of voxel indices (column, row) to canvas coordinates, and back.
  toCanvas([column, row], l = this.layout()) {
    const c = this.across.flip ? l.columns - 1 - column : column;
    const r = this.down.flip ? l.rows - 1 - row : row;
    return [l.x + (c + 0.5) * l.stepX, l.y + (r + 0.5) * l.stepY];
  }

  toVoxel([x, y], l = this.layout()) {
    const c = (x - l.x) / l.stepX - 0.5;
    const r = (y - l.y) / l.stepY - 0.5;
    const voxel = [...this.store.cursor];
    voxel[this.axis] = this.index();
    voxel[this.column] = this.across.flip ? l.columns - 1 - c : c;
    voxel[this.row] = this.down.flip ? l.rows - 1 - r : r;
    return voxel;
  }

  draw() {
    const plane = this.store.doc && this.planes.get(this.index());
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!plane || !width || !height) return;
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = width * ratio;
    this.canvas.height = height * ratio;
    const context = this.canvas.getContext("2d");
    context.scale(ratio, ratio);
    const l = this.layout();
    this.paint(plane, l);
    context.drawImage(this.image, l.x, l.y, l.w, l.h);
    this.drawCross(context, l);
    if (this.store.step === "landmarks" || this.store.step === "scan") this.drawLandmarks(context, l);
    if (this.store.step === "skin") drawCuts(context, this, l);
    const crop = this.crops() && (this.held?.crop ?? box(this.store));
    if (crop) drawCrop(context, this, crop, l);
    this.drawLetters(context, width, height);
    const { size } = this.store.doc.grid;
    this.caption.textContent = `${"ijk"[this.axis]} = ${this.index()} of ${size[this.axis]}`;
  }

  // Paints grey values by the window; removed parts outside the limb are coloured.
  paint(plane, l) {
    this.image.width = l.columns;
    this.image.height = l.rows;
    const context = this.image.getContext("2d");
    const picture = context.createImageData(l.columns, l.rows);
    const { level, width } = this.store.window;
    const removed = this.store.step === "skin" && this.store.showRemoved;
    const iso = this.store.doc.iso_hu;
    let at = 0;
    for (let y = 0; y < l.rows; y++) {
      const row = this.down.flip ? l.rows - 1 - y : y;
      for (let x = 0; x < l.columns; x++) {
        const column = this.across.flip ? l.columns - 1 - x : x;
        const index = row * l.columns + column;
        const hu = plane.hu[index];
        const grey = 255 * ((hu - level) / width + 0.5);
        const out = removed && !plane.inside[index] && hu > iso;
        picture.data[at++] = out ? 130 + grey / 2 : grey;
        picture.data[at++] = out ? 60 + grey / 3 : grey;
        picture.data[at++] = out ? 0 : grey;
        picture.data[at++] = 255;
      }
    }
    context.putImageData(picture, 0, 0);
  }

  drawCross(context, l) {
    const { cursor } = this.store;
    const [x, y] = this.toCanvas([cursor[this.column], cursor[this.row]], l);
    context.strokeStyle = COLOURS.cross;
    context.lineWidth = 1;
    context.setLineDash([4, 4]);
    line(context, [x, l.y], [x, l.y + l.h]);
    line(context, [l.x, y], [l.x + l.w, y]);
    context.setLineDash([]);
  }

  // Projects a point of the ct frame onto the canvas, and returns its distance from the slice, mm.
  project(point, l) {
    const { grid } = this.store.doc;
    const voxel = transform(inverse(grid.ct_from_voxel), point);
    const off = (voxel[this.axis] - this.index()) * grid.spacing_mm[this.axis];
    return { at: this.toCanvas([voxel[this.column], voxel[this.row]], l), off: Math.abs(off) };
  }

  // Returns the landmarks, including one that is being dragged.
  landmarks() {
    return { ...this.store.doc.landmarks, ...this.held?.changed };
  }

  drawLandmarks(context, l) {
    const found = this.landmarks();
    const ends = [-400, 400].map((s) => this.project(add(found.axis_point, scale(found.axis_direction, s)), l).at);
    context.save();
    context.beginPath();
    context.rect(l.x, l.y, l.w, l.h);
    context.clip();
    context.lineWidth = 2;
    context.strokeStyle = COLOURS.axis;
    line(context, ...ends);
    if (this.axis !== 2) {
      for (const region of ["joint_region", "calf_region"]) {
        context.strokeStyle = COLOURS[region];
        for (const mm of found[region].range_mm) {
          const edge = this.edge(mm, l);
          if (edge) line(context, ...edge);
        }
      }
    }
    context.restore();
    for (const point of found.plane_points) {
      const { at, off } = this.project(point, l);
      mark(context, at, COLOURS.plane, off < 3, "square");
    }
    const joint = this.project(found.joint_centre, l);
    mark(context, joint.at, COLOURS.joint, joint.off < 3, "circle");
  }

  // Returns the line at a border of a region: `mm` from the joint along the scan direction.
  edge(mm, l) {
    const height = (x, y) => this.along(this.toVoxel([x, y], l)) - mm;
    const cut = (x) => {
      const [top, bottom] = [height(x, l.y), height(x, l.y + l.h)];
      return top === bottom ? null : [x, l.y + l.h * top / (top - bottom)];
    };
    const ends = [cut(l.x), cut(l.x + l.w)];
    return ends.every(Boolean) ? ends : null;
  }

  // Distance of a voxel from the joint along the scan direction, mm.
  along(voxel) {
    const { grid, landmarks } = this.store.doc;
    return dot(sub(transform(grid.ct_from_voxel, voxel), landmarks.joint_centre), landmarks.scan_direction);
  }

  drawLetters(context, width, height) {
    context.fillStyle = "#fff";
    context.font = "13px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(this.across.letters[0], 10, height / 2);
    context.fillText(this.across.letters[1], width - 10, height / 2);
    context.fillText(this.down.letters[0], width / 2, 11);
    context.fillText(this.down.letters[1], width / 2, height - 11);
  }

  // Whether the step shows the crop.
  crops() {
    return this.store.step === "scan" || this.store.step === "skin";
  }

  // Returns the object under the pointer that can be dragged.
  grab(at) {
    if (this.crops() && this.store.cropping) return grabCrop(this, box(this.store), at, this.layout());
    if (this.store.step !== "landmarks") return null;
    const l = this.layout();
    const found = this.store.doc.landmarks;
    const near = ([x, y]) => Math.hypot(x - at[0], y - at[1]) < GRAB_PX;
    if (near(this.project(found.joint_centre, l).at)) return { key: "joint_centre" };
    const corner = found.plane_points.findIndex((point) => near(this.project(point, l).at));
    if (corner >= 0) return { key: "plane_points", corner };
    if (this.axis === 2) return null;
    for (const key of ["joint_region", "calf_region"]) {
      const end = found[key].range_mm.findIndex((mm) => {
        const edge = this.edge(mm, l);
        return edge && Math.abs(edge[0][1] + (edge[1][1] - edge[0][1]) * (at[0] - l.x) / l.w - at[1]) < GRAB_PX;
      });
      if (end >= 0) return { key, end };
    }
    return null;
  }

  drag(at) {
    const { grid, landmarks } = this.store.doc;
    const voxel = this.toVoxel(at);
    if (this.held.cropAxis !== undefined) {
      const { cropAxis, beside } = this.held;
      const edge = this.toVoxel([at[0] - beside[0], at[1] - beside[1]]);
      const border = Math.round(edge[cropAxis] + 0.5);
      const { held } = this;
      held.move = (doc) => moveCrop(doc, held, border);
      held.crop = held.move(this.store.doc);
      return;
    }
    const { key, corner, end } = this.held;
    if (end !== undefined) {
      const mm = Math.round(10 * this.along(voxel)) / 10;
      const range = (found) => found[key].range_mm.with(end, mm);
      this.held.changed = { [key]: { ...landmarks[key], range_mm: range(landmarks) } };
      this.held.choice = (found) => ({ [key]: range(found) });
      return;
    }
    // Moves within the slice; keeps the coordinate across it.
    const old = corner === undefined ? landmarks[key] : landmarks[key][corner];
    voxel[this.axis] = transform(inverse(grid.ct_from_voxel), old)[this.axis];
    const point = transform(grid.ct_from_voxel, voxel).map((x) => Math.round(10 * x) / 10);
    this.held.choice = (found) => ({ [key]: corner === undefined ? point : found[key].with(corner, point) });
    this.held.changed = this.held.choice(landmarks);
  }

  press(event) {
    if (!this.store.doc) return;
    this.canvas.setPointerCapture(event.pointerId);
    const at = [event.offsetX, event.offsetY];
    if (event.shiftKey || event.button === 2) {
      this.held = { window: { ...this.store.window }, at };
    } else {
      this.held = this.grab(at) ?? { cross: true };
      this.move(event);
    }
  }

  move(event) {
    if (!this.store.doc) return;
    const at = [event.offsetX, event.offsetY];
    this.actions.point(this.reading(at));
    if (!this.held) {
      this.canvas.style.cursor = this.grab(at) ? "grab" : "crosshair";
      return;
    }
    if (this.held.window) {
      const [dx, dy] = [at[0] - this.held.at[0], at[1] - this.held.at[1]];
      const { level, width } = this.held.window;
      this.actions.window({ level: level - 4 * dy, width: Math.max(10, width + 4 * dx) });
    } else if (this.held.cross) {
      this.actions.cursor(this.toVoxel(at));
    } else {
      this.drag(at);
      this.draw();
    }
  }

  release() {
    const held = this.held;
    this.held = null;
    if (held?.choice) this.actions.choose(held.choice);
    if (held?.crop && JSON.stringify(held.crop) !== JSON.stringify(box(this.store))) this.actions.crop(held.move);
  }

  turn(event) {
    event.preventDefault();
    this.step(Math.sign(event.deltaY));
  }

  step(by) {
    const cursor = [...this.store.cursor];
    cursor[this.axis] = this.index() + by;
    this.actions.cursor(cursor);
  }

  key(event) {
    const by = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10 }[event.key];
    if (!by) return;
    event.preventDefault();
    this.step(by);
  }

  // Returns HU and place under the pointer.
  reading(at) {
    const { size, ct_from_voxel } = this.store.doc.grid;
    const voxel = this.toVoxel(at).map(Math.round);
    if (voxel.some((v, i) => v < 0 || v >= size[i])) return null;
    const plane = this.planes.get(this.index());
    const hu = plane?.hu[voxel[this.row] * size[this.column] + voxel[this.column]];
    return { hu, voxel, place: transform(ct_from_voxel, voxel) };
  }
}

function line(context, a, b) {
  context.beginPath();
  context.moveTo(...a);
  context.lineTo(...b);
  context.stroke();
}

function mark(context, [x, y], colour, filled, shape) {
  context.beginPath();
  if (shape === "circle") context.arc(x, y, 6, 0, 2 * Math.PI);
  else context.rect(x - 5, y - 5, 10, 10);
  context.lineWidth = 2;
  context.strokeStyle = colour;
  context.fillStyle = colour;
  if (filled) context.fill();
  context.stroke();
}

export { COLOURS };
