// The room in the 3D view: table, detector, focal spot and view cones.

import { aim } from "/page/cameras.js";
import { facts } from "/page/elements.js";
import { fixed } from "/page/geometry.js";

export function roomFacts(room) {
  facts(document.getElementById("room-facts"), [
    ["Gap under the limb", `${fixed(room.contact.gap_mm, 2)} mm`],
    ["Depth in the table", `${fixed(room.contact.penetration_mm, 2)} mm`],
    ["Focal spot to table", `${fixed(room.source[2] - room.table_centre[2], 0)} mm`],
  ]);
}

const ring = (points) => points.flatMap((p, i) => [p, points[(i + 1) % points.length]]);

// Frames detector, focal spot and cameras in step 4, otherwise the limb on the table.
function look(view3d, room) {
  const devices = [...room.detector, room.source, ...room.cameras.map(({ centre }) => centre)];
  if (document.body.dataset.step === "room") view3d.fit(devices);
  else view3d.frame(room.table_centre, 2000);
}

export function drawRoom(view3d, room, handles, first) {
  view3d.worldFromCt = room.room_from_ct;
  view3d.handles = handles;
  const [w, l] = room.table_size_mm;
  const [x, y, z] = room.table_centre;
  const table = [[x - w / 2, y - 450, z], [x + w / 2, y - 450, z], [x + w / 2, y + l - 450, z], [x - w / 2, y + l - 450, z]];
  view3d.lines = [
    { points: ring(table), colour: "#8c96a3" },
    { points: ring(room.detector), colour: "#7ee787" },
    { points: room.detector.flatMap((corner) => [room.source, corner]), colour: "#ffd479" },
    ...room.cameras.map((camera, i) => ({
      points: [...ring(camera.corners), ...camera.corners.flatMap((corner) => [camera.centre, corner])],
      colour: ["#6cb6ff", "#ff7ad9"][i],
    })),
  ];
  view3d.points = [
    { points: [room.source], colour: "#ffd479" },
    { points: room.cameras.flatMap((camera) => [camera.centre, aim(camera)]), colour: "#ffffff", through: true },
  ];
  if (first) look(view3d, room);
  else view3d.draw();
}
