// The skin as triangles.

import { getBytes, post } from "/page/server.js";

export async function loadSurface() {
  return surfaceOf(await getBytes("skin"));
}

// Loads the surface of the parts removed outside and inside the limb.
export async function loadRemoved() {
  return surfaceOf(await getBytes("removed"));
}

// Loads the coarse surface of everything in the scan at a HU.
export async function surfaceAt(isoHu) {
  return surfaceOf(await (await post("surface_at", { iso_hu: isoHu })).arrayBuffer());
}

// Loads the skin in a body shape, with the outward displacements of its vertices, mm.
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

// Returns the distances along a ray to its first and next intersection with a surface; infinite if there is none.
// Uses scalars instead of arrays for speed: it tests all triangles while a landmark is dragged.
export function hit({ positions, corners }, [ox, oy, oz], [dx, dy, dz]) {
  let [nearest, next] = [Infinity, Infinity];
  for (let t = 0; t < corners.length; t += 3) {
    const [a, b, c] = [3 * corners[t], 3 * corners[t + 1], 3 * corners[t + 2]];
    const ax = positions[a];
    const ay = positions[a + 1];
    const az = positions[a + 2];
    const ux = positions[b] - ax;
    const uy = positions[b + 1] - ay;
    const uz = positions[b + 2] - az;
    const vx = positions[c] - ax;
    const vy = positions[c + 1] - ay;
    const vz = positions[c + 2] - az;
    const hx = dy * vz - dz * vy;
    const hy = dz * vx - dx * vz;
    const hz = dx * vy - dy * vx;
    const det = ux * hx + uy * hy + uz * hz;
    if (Math.abs(det) < 1e-9) continue;
    const sx = ox - ax;
    const sy = oy - ay;
    const sz = oz - az;
    const p = (sx * hx + sy * hy + sz * hz) / det;
    if (p < 0 || p > 1) continue;
    const qx = sy * uz - sz * uy;
    const qy = sz * ux - sx * uz;
    const qz = sx * uy - sy * ux;
    const r = (dx * qx + dy * qy + dz * qz) / det;
    if (r < 0 || p + r > 1) continue;
    const distance = (vx * qx + vy * qy + vz * qz) / det;
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
