// Vectors of three numbers and transforms as four rows.

export const add = (a, b) => a.map((x, i) => x + b[i]);
export const sub = (a, b) => a.map((x, i) => x - b[i]);
export const scale = (a, s) => a.map((x) => x * s);
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const norm = (a) => Math.hypot(...a);
export const unit = (a) => scale(a, 1 / (norm(a) || 1));

// Angle between two directions, degrees.
export function angleDeg(a, b) {
  return Math.atan2(norm(cross(a, b)), dot(a, b)) * 180 / Math.PI;
}

export function transform(rows, p) {
  return [0, 1, 2].map((i) => dot(rows[i], p) + rows[i][3]);
}

export function rotate(rows, p) {
  return [0, 1, 2].map((i) => dot(rows[i], p));
}

// Rotates a vector by an angle about an axis of the frame.
export function rotatedAbout(p, axis, degrees) {
  const [sin, cos] = [Math.sin(degrees * Math.PI / 180), Math.cos(degrees * Math.PI / 180)];
  const [b, c] = [(axis + 1) % 3, (axis + 2) % 3];
  const made = [...p];
  made[b] = cos * p[b] - sin * p[c];
  made[c] = sin * p[b] + cos * p[c];
  return made;
}

// Inverse of an affine transform.
export function inverse(rows) {
  const columns = [0, 1, 2].map((j) => [0, 1, 2].map((i) => rows[i][j]));
  const det = dot(columns[0], cross(columns[1], columns[2]));
  const inverted = [
    scale(cross(columns[1], columns[2]), 1 / det),
    scale(cross(columns[2], columns[0]), 1 / det),
    scale(cross(columns[0], columns[1]), 1 / det),
  ];
  const origin = [0, 1, 2].map((i) => rows[i][3]);
  return inverted.map((row) => [...row, -dot(row, origin)]);
}

export const IDENTITY = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]];

// Normal of the plane through three points.
export function planeNormal([a, b, c]) {
  return unit(cross(sub(b, a), sub(c, a)));
}

// Formats a number with fixed decimals, without a minus sign before zero.
export function fixed(x, digits = 1) {
  const text = x.toFixed(digits);
  return Number(text) === 0 ? (0).toFixed(digits) : text;
}

export const point = (p, digits = 1) => p.map((x) => fixed(x, digits)).join(", ");
