// 3D view of the skin, the landmarks and the room, drawn by WebGL 2, or by the CPU if the browser has no WebGL 2.

import { IDENTITY, add, cross, dot, inverse, norm, rotate, scale, sub, transform, unit } from "/page/geometry.js";
import { SoftwarePainter } from "/page/software.js";
import { bounds, hit } from "/page/surface.js";

const VERTEX = `#version 300 es
uniform mat4 screenFromModel;
uniform mat3 eyeFromModel;
in vec3 position;
in vec3 normal;
in float outwards;
out vec3 facing;
out float moved;
void main() {
  gl_Position = screenFromModel * vec4(position, 1.0);
  gl_PointSize = 11.0;
  facing = eyeFromModel * normal;
  moved = outwards;
}`;

const FRAGMENT = `#version 300 es
precision mediump float;
uniform vec4 colour;
uniform float shaded;
uniform float mostMoved;
in vec3 facing;
in float moved;
out vec4 pixel;
const vec3 OUTWARDS = vec3(1.0, 0.45, 0.05);
const vec3 INWARDS = vec3(0.15, 0.4, 1.0);
void main() {
  float light = shaded > 0.5 ? 0.25 + 0.75 * abs(normalize(facing).z) : 1.0;
  float share = mostMoved > 0.0 ? clamp(abs(moved) / mostMoved, 0.0, 1.0) : 0.0;
  vec3 painted = mix(colour.rgb, moved > 0.0 ? OUTWARDS : INWARDS, share);
  pixel = vec4(painted * light, colour.a);
}`;

// Maximum depth of a picked point below the surface, along the line of sight; half-way through thinner objects.
const INSIDE_MM = 5;

const SKIN = [0.86, 0.68, 0.58, 1];
// Colour as in the slices; faint where hidden by the skin.
const REMOVED = { colour: [1, 0.58, 0.1], seen: 0.45, hidden: 0.1 };

// Movement below which a press is a click.
const CLICK_PX = 4;
// Distance within which the pointer grabs a handle, CSS pixels.
const GRAB_PX = 10;
// Depth below the skin at which points are hidden by it.
const HIDDEN_MM = 8;

const FIELD_OF_VIEW = 30 * Math.PI / 180;

export class View3d {
  constructor(figure, actions) {
    this.canvas = figure.querySelector("canvas");
    this.caption = figure.querySelector("figcaption");
    this.actions = actions;
    this.surface = null;
    // Surface of the removed parts, if shown with the skin.
    this.removed = null;
    this.worldFromCt = IDENTITY;
    this.lines = [];
    this.points = [];
    this.turn = { azimuth: -0.6, elevation: 0.25 };
    this.centre = [0, 0, 0];
    this.distance = 1000;
    // Places that can be dragged: `at`, `onSkin`, `move` for each place on the way, and `drop` for the last one.
    this.handles = [];
    this.gl = this.canvas.getContext("webgl2", { antialias: true });
    if (this.gl) {
      this.prepare();
    } else {
      this.caption.textContent = "drawn without WebGL 2";
      this.software = new SoftwarePainter(this.canvas);
    }
    this.listen(figure);
  }

  prepare() {
    const { gl } = this;
    const compile = (kind, source) => {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      return shader;
    };
    this.program = gl.createProgram();
    gl.attachShader(this.program, compile(gl.VERTEX_SHADER, VERTEX));
    gl.attachShader(this.program, compile(gl.FRAGMENT_SHADER, FRAGMENT));
    gl.bindAttribLocation(this.program, 0, "position");
    gl.bindAttribLocation(this.program, 1, "normal");
    gl.bindAttribLocation(this.program, 2, "outwards");
    gl.linkProgram(this.program);
    this.uniform = (name) => gl.getUniformLocation(this.program, name);
    const buffers = () => ({ positions: gl.createBuffer(), normals: gl.createBuffer(), outwards: gl.createBuffer(), corners: gl.createBuffer() });
    this.buffers = { skin: buffers(), removed: buffers(), lines: gl.createBuffer() };
  }

  listen(figure) {
    new ResizeObserver(() => this.draw()).observe(figure);
    let held = null;
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      held = { x: event.offsetX, y: event.offsetY, moved: 0, handle: this.handleAt(event.offsetX, event.offsetY), ...this.turn };
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!held) {
        this.canvas.style.cursor = this.handleAt(event.offsetX, event.offsetY) ? "grab" : "";
        return;
      }
      const [dx, dy] = [event.offsetX - held.x, event.offsetY - held.y];
      held.moved = Math.max(held.moved, Math.hypot(dx, dy));
      if (held.handle) {
        if (held.moved >= CLICK_PX) held.place = this.drag(held.handle, event.offsetX, event.offsetY) ?? held.place;
        return;
      }
      this.turn.azimuth = held.azimuth - 0.008 * dx;
      this.turn.elevation = Math.max(-1.55, Math.min(1.55, held.elevation + 0.008 * dy));
      this.draw();
    });
    this.canvas.addEventListener("pointerup", (event) => {
      if (held?.place) held.handle.drop(held.place);
      else if (held && held.moved < CLICK_PX) this.pick(event.offsetX, event.offsetY);
      held = null;
    });
    this.canvas.addEventListener("pointercancel", () => {
      held?.handle?.move(null);
      held = null;
    });
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.distance *= Math.exp(0.001 * event.deltaY);
      this.draw();
    }, { passive: false });
    this.canvas.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
      const zoom = { "+": 0.9, "-": 1.1 }[event.key];
      if (!by && !zoom) return;
      event.preventDefault();
      if (by) {
        this.turn.azimuth += by[0];
        this.turn.elevation = Math.max(-1.55, Math.min(1.55, this.turn.elevation + by[1]));
      }
      this.distance *= zoom ?? 1;
      this.draw();
    });
  }

  show(surface) {
    this.surface = surface;
    this.mostMoved = surface.outwards?.reduce((most, mm) => Math.max(most, Math.abs(mm)), 0) ?? 0;
    this.load(surface, this.buffers?.skin);
  }

  // Sets the second surface, or none.
  showRemoved(surface) {
    this.removed = surface;
    if (surface) this.load(surface, this.buffers?.removed);
  }

  load(surface, buffers) {
    if (!this.gl) return;
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.positions);
    gl.bufferData(gl.ARRAY_BUFFER, surface.positions, gl.STATIC_DRAW);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.normals);
    gl.bufferData(gl.ARRAY_BUFFER, surface.normals, gl.STATIC_DRAW);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.outwards);
    gl.bufferData(gl.ARRAY_BUFFER, surface.outwards ?? new Float32Array(surface.positions.length / 3), gl.STATIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.corners);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, surface.corners, gl.STATIC_DRAW);
  }

  // Frames the skin, or a place in the room.
  frame(centre = null, distance = null) {
    const { low, high } = bounds(this.surface);
    this.centre = centre ?? transform(this.worldFromCt, scale(add(low, high), 0.5));
    this.distance = distance ?? 1.1 * norm(sub(high, low)) / (2 * Math.tan(FIELD_OF_VIEW / 2));
    this.draw();
  }

  // Frames places in the world so that all are visible.
  fit(places) {
    const axes = [0, 1, 2].map((axis) => places.map((place) => place[axis]));
    this.centre = axes.map((values) => (Math.min(...values) + Math.max(...values)) / 2);
    const { right, up, back } = this.eye();
    const half = 0.92 * Math.tan(FIELD_OF_VIEW / 2);
    const aspect = this.canvas.clientWidth / this.canvas.clientHeight || 1;
    const needed = places.map((place) => {
      const from = sub(place, this.centre);
      return dot(from, back) + Math.max(Math.abs(dot(from, up)), Math.abs(dot(from, right)) / aspect) / half;
    });
    this.distance = Math.max(...needed);
    this.draw();
  }

  // Returns the eye and the directions right, up and backwards on the screen, in the world.
  eye() {
    const { azimuth, elevation } = this.turn;
    const back = [Math.cos(elevation) * Math.sin(azimuth), -Math.cos(elevation) * Math.cos(azimuth), Math.sin(elevation)];
    const right = unit(cross([0, 0, 1], back));
    return { at: add(this.centre, scale(back, this.distance)), right, up: cross(back, right), back };
  }

  screenFromWorld({ at, right, up, back }) {
    const aspect = this.canvas.clientWidth / this.canvas.clientHeight;
    const f = 1 / Math.tan(FIELD_OF_VIEW / 2);
    const [near, far] = [this.distance / 50, this.distance * 20];
    const view = [right, up, back].map((row) => [...row, -dot(row, at)]);
    const [a, b] = [(far + near) / (near - far), 2 * far * near / (near - far)];
    const row = (r, s) => r.map((x) => x * s);
    return [row(view[0], f / aspect), row(view[1], f), [...row(view[2], a).slice(0, 3), a * view[2][3] + b], row(view[2], -1)];
  }

  draw() {
    const { gl, canvas } = this;
    if (!this.surface || !canvas.clientWidth || !canvas.clientHeight) return;
    if (this.software) {
      const bytes = (colour) => colour.slice(0, 3).map((c) => 255 * c);
      const eye = this.eye();
      this.colour = { skin: bytes(SKIN), removed: bytes(REMOVED.colour), seen: REMOVED.seen, hidden: REMOVED.hidden };
      this.software.draw(this, this.screenFromWorld(eye), eye);
      return;
    }
    const ratio = window.devicePixelRatio || 1;
    canvas.width = canvas.clientWidth * ratio;
    canvas.height = canvas.clientHeight * ratio;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.04, 0.05, 0.07, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(this.program);
    const eye = this.eye();
    const screen = this.screenFromWorld(eye);
    this.place(screen, eye, this.worldFromCt);
    gl.uniform1f(this.uniform("mostMoved"), this.mostMoved);
    this.paint(SKIN, 1);
    this.triangles(this.surface, this.buffers.skin);
    if (this.removed) this.drawRemoved();
    this.place(screen, eye, IDENTITY);
    gl.disableVertexAttribArray(1);
    gl.disableVertexAttribArray(2);
    gl.uniform1f(this.uniform("mostMoved"), 0);
    for (const { points, colour, through } of this.lines) this.segments(gl.LINES, points, colour, through);
    for (const { points, colour, through } of this.points) this.segments(gl.POINTS, points, colour, through);
  }

  // Draws the removed parts translucent, over the skin.
  drawRemoved() {
    const { gl } = this;
    gl.uniform1f(this.uniform("mostMoved"), 0);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ZERO, gl.ONE);
    gl.depthMask(false);
    for (const [test, alpha] of [[gl.GREATER, REMOVED.hidden], [gl.LESS, REMOVED.seen]]) {
      gl.depthFunc(test);
      this.paint([...REMOVED.colour, alpha], 1);
      this.triangles(this.removed, this.buffers.removed);
    }
    gl.depthFunc(gl.LESS);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
  }

  triangles(surface, buffers) {
    const { gl } = this;
    this.attribute(0, buffers.positions);
    this.attribute(1, buffers.normals);
    this.attribute(2, buffers.outwards, 1);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.corners);
    gl.drawElements(gl.TRIANGLES, surface.corners.length, gl.UNSIGNED_INT, 0);
  }

  segments(kind, points, colour, through) {
    const { gl } = this;
    // Landmarks inside the limb are visible through the skin.
    if (through) gl.disable(gl.DEPTH_TEST); else gl.enable(gl.DEPTH_TEST);
    this.paint([1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16) / 255).concat(1), 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers.lines);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(points.flat()), gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.drawArrays(kind, 0, points.length);
  }

  attribute(index, buffer, size = 3) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(index);
    gl.vertexAttribPointer(index, size, gl.FLOAT, false, 0, 0);
  }

  paint(colour, shaded) {
    this.gl.uniform4fv(this.uniform("colour"), colour);
    this.gl.uniform1f(this.uniform("shaded"), shaded);
  }

  place(screen, eye, worldFromModel) {
    const columns = [0, 1, 2].map((j) => worldFromModel.map((row) => row[j]).slice(0, 3));
    const origin = worldFromModel.map((row) => row[3]).slice(0, 3);
    const model = [...columns.map((c) => screen.map((row) => dot(row, c))), screen.map((row) => dot(row, origin) + row[3])];
    this.gl.uniformMatrix4fv(this.uniform("screenFromModel"), false, model.flat());
    const facing = columns.map((c) => [dot(eye.right, c), dot(eye.up, c), dot(eye.back, c)]);
    this.gl.uniformMatrix3fv(this.uniform("eyeFromModel"), false, facing.flat());
  }

  // Returns the line of sight at a place of the canvas, in the ct frame.
  sight(x, y) {
    const { at, right, up, back } = this.eye();
    const half = Math.tan(FIELD_OF_VIEW / 2);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const [u, v] = [(2 * x / width - 1) * half * width / height, (1 - 2 * y / height) * half];
    const direction = unit(add(add(scale(right, u), scale(up, v)), scale(back, -1)));
    const ctFromWorld = inverse(this.worldFromCt);
    return { origin: transform(ctFromWorld, at), along: rotate(ctFromWorld, direction), back: rotate(ctFromWorld, back) };
  }

  // Returns the visible handle under the pointer.
  handleAt(x, y) {
    if (!this.surface || this.handles.length === 0) return null;
    const screen = this.screenFromWorld(this.eye());
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const away = ({ at }) => {
      const place = transform(this.worldFromCt, at);
      const [px, py, , w] = screen.map((row) => dot(row, place) + row[3]);
      return w > 0 ? Math.hypot((1 + px / w) * width / 2 - x, (1 - py / w) * height / 2 - y) : Infinity;
    };
    const near = this.handles.filter((handle) => away(handle) < GRAB_PX).sort((a, b) => away(a) - away(b));
    // A handle on the far side would jump to the near side.
    return near.find(({ at, onSkin }) => {
      if (!onSkin) return true;
      const { origin } = this.sight(x, y);
      const to = sub(at, origin);
      return hit(this.surface, origin, unit(to)).nearest > norm(to) - HIDDEN_MM;
    }) ?? null;
  }

  // Drags a handle along the skin or across the line of sight, and returns its place; null if there is no skin.
  drag(handle, x, y) {
    const { origin, along, back } = this.sight(x, y);
    const distance = handle.onSkin ? hit(this.surface, origin, along).nearest : dot(sub(handle.at, origin), back) / dot(along, back);
    if (!Number.isFinite(distance)) return null;
    const place = rounded(add(origin, scale(along, distance)));
    handle.move(place);
    return place;
  }

  // Picks the surface point under the pointer, and one behind it, in the ct frame.
  pick(x, y) {
    if (!this.surface) return;
    const { origin, along } = this.sight(x, y);
    const hits = [this.surface, this.removed].filter(Boolean).map((surface) => hit(surface, origin, along));
    const { nearest, next } = hits.reduce((one, other) => (other.nearest < one.nearest ? other : one));
    if (nearest === Infinity) return;
    const point = add(origin, scale(along, nearest));
    const inside = add(point, scale(along, Math.min(INSIDE_MM, (next - nearest) / 2)));
    this.actions.picked(rounded(point), rounded(inside));
  }
}

const rounded = (place) => place.map((c) => Math.round(10 * c) / 10);
