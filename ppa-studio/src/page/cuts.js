// Balls cut off from the scan in step 2: a list, and circles in the slices.

import { button, element } from "/page/elements.js";
import { fixed, inverse, point, transform } from "/page/geometry.js";

const byId = (id) => document.getElementById(id);

const COLOUR = "#ff9419";

// Draws the circles of a slice: those of the balls cut off, and dashed that of the next ball.
export function drawCuts(context, view, l) {
  const { doc, cursor, ball } = view.store;
  const voxelFromCt = inverse(doc.grid.ct_from_voxel);
  const balls = doc.removed.map(({ centre_mm, radius_mm }) => ({ voxel: transform(voxelFromCt, centre_mm), radius_mm }));
  for (const one of balls) circle(context, view, l, one);
  if (!ball) return;
  context.setLineDash([6, 3]);
  circle(context, view, l, { voxel: cursor, radius_mm: ball });
  context.setLineDash([]);
}

// Draws the section of a ball with the slice. Assumes orthogonal voxel axes.
function circle(context, view, l, { voxel, radius_mm }) {
  const { spacing_mm } = view.store.doc.grid;
  const off_mm = (voxel[view.axis] - view.index()) * spacing_mm[view.axis];
  const section_mm = Math.sqrt(radius_mm ** 2 - off_mm ** 2);
  if (!(section_mm > 0)) return;
  const at = view.toCanvas([voxel[view.column], voxel[view.row]], l);
  context.strokeStyle = COLOUR;
  context.lineWidth = 2;
  context.beginPath();
  context.arc(...at, section_mm * l.stepX / spacing_mm[view.column], 0, 2 * Math.PI);
  context.stroke();
}

export class CutPanel {
  // `actions.remove` takes a function that changes the list of balls, `actions.redraw` redraws the slices, `actions.crosshair` returns a place in the scan, mm.
  constructor(store, actions) {
    Object.assign(this, { store, actions, shown: 0 });
    byId("cut-radius").addEventListener("input", () => this.changed());
    byId("cut").addEventListener("toggle", () => this.changed());
    byId("cut-here").addEventListener("click", () => {
      const ball = { centre_mm: actions.crosshair(), radius_mm: Number(byId("cut-radius").value) };
      actions.remove((balls) => [...balls, ball]);
    });
  }

  // The next ball has changed, or there is none.
  changed() {
    byId("cut-radius-value").textContent = byId("cut-radius").value;
    this.store.ball = byId("cut").open ? Number(byId("cut-radius").value) : null;
    this.actions.redraw();
  }

  show() {
    const balls = this.store.doc.removed;
    byId("cuts").replaceChildren(...balls.map((ball) => {
      const where = `the ball around ${point(ball.centre_mm, 0)} mm`;
      const item = element("li", `ball of ${fixed(ball.radius_mm, 0)} mm around ${point(ball.centre_mm, 0)} mm `);
      item.append(button("Show", () => this.actions.place(ball.centre_mm), `Show ${where}`));
      item.append(button("Put back", () => this.actions.remove((all) => all.filter((other) => JSON.stringify(other) !== JSON.stringify(ball))), `Put back ${where}`));
      return item;
    }));
    if (balls.length > this.shown) byId("cut").open = true;
    this.shown = balls.length;
  }
}
