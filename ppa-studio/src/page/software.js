// The 3D view without WebGL 2: draws triangles, lines and points with a depth buffer into the pixels of a canvas.

const GROUND = [10, 13, 18];
const OUTWARDS = [255, 115, 13];
const INWARDS = [38, 102, 255];
const POINT_PX = 11;

const packed = ([r, g, b]) => (255 << 24 | b << 16 | g << 8 | r) >>> 0;
const mixed = (a, b, share) => a.map((x, i) => x + share * (b[i] - x));

export class SoftwarePainter {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
  }

  // Draws a view; `screen` has the four rows of the transform from the world to clip coordinates.
  draw(view, screen, eye) {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    this.canvas.width = width;
    this.canvas.height = height;
    Object.assign(this, { width, height, screen });
    this.picture = this.context.createImageData(width, height);
    this.pixels = new Uint32Array(this.picture.data.buffer).fill(packed(GROUND));
    // Depth buffer of nearness: 1 / w in clip coordinates, 0 for the background.
    this.near = new Float32Array(width * height);
    const { colour } = view;
    const skin = (vertex, light) => packed(this.moved(colour.skin, view, vertex).map((c) => c * light));
    this.triangles(view.surface, view.worldFromCt, eye, skin, this.near, this.pixels);
    if (view.removed) this.removed(view, eye);
    for (const { points, colour: named, through } of view.lines) {
      for (let i = 0; i + 1 < points.length; i += 2) this.line(points[i], points[i + 1], hexadecimal(named), through);
    }
    for (const { points, colour: named, through } of view.points) {
      for (const point of points) this.point(point, hexadecimal(named), through);
    }
    this.context.putImageData(this.picture, 0, 0);
  }

  moved(colour, { surface, mostMoved }, vertex) {
    if (!mostMoved) return colour;
    const mm = surface.outwards[vertex];
    return mixed(colour, mm > 0 ? OUTWARDS : INWARDS, Math.min(1, Math.abs(mm) / mostMoved));
  }

  // Draws the removed parts translucent, over the skin.
  removed({ removed, worldFromCt, colour }, eye) {
    const near = new Float32Array(this.near.length);
    const pixels = new Uint32Array(this.near.length);
    const of = (_, light) => packed(colour.removed.map((c) => c * light));
    this.triangles(removed, worldFromCt, eye, of, near, pixels);
    const parts = (pixel) => [pixel & 255, pixel >> 8 & 255, pixel >> 16 & 255];
    near.forEach((depth, i) => {
      if (depth === 0) return;
      const alpha = depth > this.near[i] ? colour.seen : colour.hidden;
      this.pixels[i] = packed(mixed(parts(this.pixels[i]), parts(pixels[i]), alpha));
    });
  }

  // Returns pixel and nearness of a point in the world; nearness is 0 or negative behind the eye.
  project([x, y, z]) {
    const row = ([a, b, c, d]) => a * x + b * y + c * z + d;
    const w = row(this.screen[3]);
    return [(1 + row(this.screen[0]) / w) * this.width / 2, (1 - row(this.screen[1]) / w) * this.height / 2, 1 / w];
  }

  // Draws each triangle in the colour of its first corner.
  triangles({ positions, normals, corners }, worldFromModel, eye, colourOf, near, pixels) {
    const { width, height } = this;
    const [r0, r1, r2] = worldFromModel;
    const count = positions.length / 3;
    const [xs, ys, depths] = [new Float32Array(count), new Float32Array(count), new Float32Array(count)];
    for (let i = 0; i < count; i++) {
      const [x, y, z] = [positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]];
      const at = [r0, r1, r2].map((r) => r[0] * x + r[1] * y + r[2] * z + r[3]);
      [xs[i], ys[i], depths[i]] = this.project(at);
    }
    const facing = (i) => {
      const [x, y, z] = [normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]];
      return [r0, r1, r2].reduce((sum, r, axis) => sum + eye.back[axis] * (r[0] * x + r[1] * y + r[2] * z), 0);
    };
    for (let t = 0; t < corners.length; t += 3) {
      const [a, b, c] = [corners[t], corners[t + 1], corners[t + 2]];
      if (depths[a] <= 0 || depths[b] <= 0 || depths[c] <= 0) continue;
      const area = (xs[b] - xs[a]) * (ys[c] - ys[a]) - (xs[c] - xs[a]) * (ys[b] - ys[a]);
      if (area === 0) continue;
      const left = Math.max(0, Math.ceil(Math.min(xs[a], xs[b], xs[c]) - 0.5));
      const right = Math.min(width - 1, Math.floor(Math.max(xs[a], xs[b], xs[c]) - 0.5));
      const top = Math.max(0, Math.ceil(Math.min(ys[a], ys[b], ys[c]) - 0.5));
      const bottom = Math.min(height - 1, Math.floor(Math.max(ys[a], ys[b], ys[c]) - 0.5));
      if (left > right || top > bottom) continue;
      let colour = null;
      for (let y = top; y <= bottom; y++) {
        for (let x = left; x <= right; x++) {
          const [px, py] = [x + 0.5, y + 0.5];
          const v = ((px - xs[a]) * (ys[c] - ys[a]) - (xs[c] - xs[a]) * (py - ys[a])) / area;
          const w = ((xs[b] - xs[a]) * (py - ys[a]) - (px - xs[a]) * (ys[b] - ys[a])) / area;
          if (v < 0 || w < 0 || v + w > 1) continue;
          const depth = depths[a] + v * (depths[b] - depths[a]) + w * (depths[c] - depths[a]);
          const i = y * width + x;
          if (depth <= near[i]) continue;
          colour ??= colourOf(a, 0.25 + 0.75 * Math.abs(facing(a)));
          near[i] = depth;
          pixels[i] = colour;
        }
      }
    }
  }

  // Draws the part of a line in front of the eye.
  line(from, to, colour, through) {
    const depth = ([x, y, z]) => this.screen[3][0] * x + this.screen[3][1] * y + this.screen[3][2] * z + this.screen[3][3];
    let [p, q] = [from, to];
    const [a, b] = [depth(p), depth(q)];
    const least = 1;
    if (a < least && b < least) return;
    const cut = () => mixed(from, to, (least - a) / (b - a));
    if (a < least) p = cut();
    if (b < least) q = cut();
    const [[x0, y0, n0], [x1, y1, n1]] = [this.project(p), this.project(q)];
    const [dx, dy] = [x1 - x0, y1 - y0];
    const steps = Math.ceil(Math.max(Math.abs(dx), Math.abs(dy), 1));
    // Clips the line to the canvas.
    const inside = [[-dx, x0], [dx, this.width - x0], [-dy, y0], [dy, this.height - y0]];
    let [first, last] = [0, 1];
    for (const [slope, room] of inside) {
      if (slope > 0) last = Math.min(last, room / slope);
      else if (slope < 0) first = Math.max(first, room / slope);
      else if (room < 0) return;
    }
    for (let step = Math.floor(first * steps); step <= last * steps; step++) {
      const share = step / steps;
      this.dot(Math.floor(x0 + share * dx), Math.floor(y0 + share * dy), n0 + share * (n1 - n0), colour, through);
    }
  }

  point(place, colour, through) {
    const [x, y, nearness] = this.project(place);
    if (nearness <= 0) return;
    const half = (POINT_PX - 1) / 2;
    for (let dy = -half; dy <= half; dy++) {
      for (let dx = -half; dx <= half; dx++) this.dot(Math.floor(x) + dx, Math.floor(y) + dy, nearness, colour, through);
    }
  }

  dot(x, y, nearness, colour, through) {
    if (x < 0 || y < 0 || x >= this.width || y >= this.height) return;
    const i = y * this.width + x;
    if (!through && nearness < this.near[i]) return;
    this.pixels[i] = colour;
  }
}

const hexadecimal = (colour) => packed([1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16)));
