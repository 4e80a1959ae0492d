// The skin as triangles.

import { getBytes, post } from "/page/server.js";
import { cross, dot, sub } from "/page/geometry.js";

export async function loadSurface() {
  return surfaceOf(await getBytes("skin"));
}

// What was removed beside the limb and inside it.
export async function loadRemoved() {
  return surfaceOf(await getBytes("removed"));
}

// The coarse surface of everything in the scan at a HU.
export async function surfaceAt(isoHu) {
  return surfaceOf(await (await post("surface_at", { iso_hu: isoHu })).arrayBuffer());
}

// The skin in a body shape, with how far its vertices moved outwards, mm.
export async function loadShape(shape) {
  return surfaceOf(await (await post("body_shape", { shape })).arrayBuffer());
}

function surfaceOf(bytes) {
  const [vertices, triangles] = new Uint32Array(bytes, 0, 2);
  const positions = new Float32Array(bytes, 8, 3 * vertices);
  const normals = new Float32Array(bytes, 8 + 12 * vertices, 3 * vertices);
  const corners = new Uint32Array(bytes, 8 + 24 * vertices, 3 * triangles);
  const end = 8 + 24 * vertices + 12 * triangles;
  const outwards = bytes.byteLength > end ? new Float32Array(bytes, end, vertices) : null;
  return { positions, normals, corners, outwards };
}

const vertex = (surface, id) => surface.positions.subarray(3 * id, 3 * id + 3);

// Where a ray first meets a surface, and the next place where it meets the same one, as distances along it; infinite where it does not.
export function hit(surface, origin, direction) {
  let [nearest, next] = [Infinity, Infinity];
  const { corners } = surface;
  for (let t = 0; t < corners.length; t += 3) {
    const [a, b, c] = [corners[t], corners[t + 1], corners[t + 2]].map((id) => Array.from(vertex(surface, id)));
    const [u, v] = [sub(b, a), sub(c, a)];
    const h = cross(direction, v);
    const det = dot(u, h);
    if (Math.abs(det) < 1e-9) continue;
    const s = sub(origin, a);
    const p = dot(s, h) / det;
    if (p < 0 || p > 1) continue;
    const q = cross(s, u);
    const r = dot(direction, q) / det;
    if (r < 0 || p + r > 1) continue;
    const distance = dot(v, q) / det;
    if (distance <= 1e-6) continue;
    if (distance < nearest) [nearest, next] = [distance, nearest];
    else if (distance > nearest) next = Math.min(next, distance);
  }
  return { nearest, next };
}

export function bounds(surface) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  surface.positions.forEach((x, i) => {
    low[i % 3] = Math.min(low[i % 3], x);
    high[i % 3] = Math.max(high[i % 3], x);
  });
  return { low, high };
}
