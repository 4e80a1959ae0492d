// The page: one store, one place that changes it, views that follow.

import { getJson, newest, postJson } from "/page/server.js";
import { fixed, inverse, point, transform, IDENTITY } from "/page/geometry.js";
import { SliceView } from "/page/slices.js";
import { loadSurface, surfaceAt } from "/page/surface.js";
import { View3d } from "/page/view3d.js";
import { LandmarkPanel } from "/page/landmarks.js";
import { WhatIfPanel } from "/page/whatif.js";

const byId = (id) => document.getElementById(id);
const STEPS = ["scan", "skin", "landmarks", "room", "whatif"];
const WINDOWS = [["Soft tissue", 40, 400], ["Bone", 400, 1800], ["Skin", -300, 1200], ["All", 200, 3000]];

const store = { doc: null, step: "scan", cursor: [0, 0, 0], window: { level: 200, width: 1600 }, showRemoved: true };

const actions = { choose, cursor: setCursor, window: setWindow, point: showReading, picked, fail, tell, room: showRoom, commands: showImageCommands };

const slices = [...document.querySelectorAll(".view[data-axis]")].map((figure) => new SliceView(figure, store, actions));
const view3d = new View3d(byId("view3d"), actions);
const landmarks = new LandmarkPanel(store, actions);
const whatIf = new WhatIfPanel(store, actions);
let room = null;

function tell(text) {
  byId("message").className = "quiet";
  byId("message").textContent = text;
}

function fail(error) {
  byId("message").className = "";
  byId("message").textContent = error.message;
}

// Changes what the program knows, and shows what follows.
async function change(path, body) {
  document.body.setAttribute("aria-busy", "true");
  try {
    await show(await postJson(path, body));
    tell("");
  } catch (error) {
    fail(error);
    landmarks.show();
    slices.forEach((view) => view.draw());
  } finally {
    document.body.removeAttribute("aria-busy");
  }
}

// Landmarks that a person chooses; null leaves one to be found again. Regions and points of the axis exclude each other.
function choose(changes) {
  const choices = { ...store.doc.choices, ...changes };
  if (["joint_region", "calf_region", "axis_source"].some((key) => changes[key])) delete choices.axis;
  const given = Object.entries(choices).filter(([, value]) => value !== null && value !== undefined);
  return change("choices", Object.fromEntries(given));
}

async function show(doc) {
  const before = store.doc;
  store.doc = doc;
  byId("name").textContent = doc.name;
  document.title = `${doc.name} - ppa studio`;
  byId("undo").disabled = !doc.can_undo;
  byId("redo").disabled = !doc.can_redo;
  const { has_edits, is_saved, edited, original } = doc.files;
  byId("save").disabled = is_saved && !has_edits;
  byId("save").textContent = is_saved ? "Save over the case" : "Save the case";
  byId("saved").textContent = has_edits ? `changes saved in ${edited}` : is_saved ? "no changes" : `${original} is not saved yet`;
  if (!before) setCursor(transform(inverse(doc.grid.ct_from_voxel), doc.landmarks.joint_centre));
  const skinChanged = !before || before.iso_hu !== doc.iso_hu || before.side !== doc.side
    || JSON.stringify(before.report) !== JSON.stringify(doc.report);
  if (skinChanged) slices.forEach((view) => view.forget());
  showScan(doc);
  showSkin(doc);
  landmarks.show();
  showCommands();
  slices.forEach((view) => view.update());
  if (skinChanged) await showSurface(!before);
  drawLandmarks();
  whatIf.show();
  whatIf.changed();
}

async function showSurface(first) {
  view3d.show(await loadSurface());
  if (first) view3d.frame();
}

// While the slider moves: everything in the scan at this HU. The limb follows when it is let go.
async function showSurfaceAt(isoHu) {
  try {
    const surface = await surfaceAt(isoHu);
    if (Number(byId("iso").value) !== store.doc.iso_hu) {
      view3d.show(surface);
      view3d.draw();
    }
  } catch (error) {
    if (error.status !== 409) fail(error);
  }
}

function drawLandmarks() {
  if (store.step === "room" || store.step === "whatif") return;
  view3d.worldFromCt = IDENTITY;
  const drawing = landmarks.drawing();
  view3d.lines = drawing.lines;
  view3d.points = drawing.points;
  view3d.draw();
}

function facts(id, pairs) {
  byId(id).replaceChildren(...pairs.flatMap(([name, value]) => {
    const [dt, dd] = [document.createElement("dt"), document.createElement("dd")];
    dt.textContent = name;
    dd.textContent = value;
    return [dt, dd];
  }));
}

function showScan(doc) {
  facts("scan-facts", [
    ["Voxels", doc.grid.size.join(" × ")],
    ["Spacing", `${doc.grid.spacing_mm.map((x) => fixed(x, 3)).join(" × ")} mm`],
    ["Side", doc.side === "r" ? "right" : "left"],
  ]);
  const items = doc.findings.map((finding) => {
    const item = document.createElement("li");
    item.className = finding.severity;
    item.textContent = `${finding.severity} [${finding.code}] ${finding.text} `;
    if (finding.place_mm) item.append(button("Show", () => setCursor(transform(inverse(doc.grid.ct_from_voxel), finding.place_mm)), `Show ${finding.code}`));
    if (finding.severity === "severe") {
      const known = doc.acknowledged.includes(finding.code);
      const codes = known ? doc.acknowledged.filter((code) => code !== finding.code) : [...doc.acknowledged, finding.code];
      item.append(button(known ? "Acknowledged" : "Acknowledge", () => change("acknowledged", codes), `Acknowledge ${finding.code}`));
    }
    return item;
  });
  if (items.length === 0) {
    const none = document.createElement("li");
    none.textContent = "none";
    items.push(none);
  }
  byId("findings").replaceChildren(...items);
}

function button(text, act, label = text) {
  const made = document.createElement("button");
  made.type = "button";
  made.textContent = text;
  made.setAttribute("aria-label", label);
  made.addEventListener("click", act);
  return made;
}

function showSkin(doc) {
  byId("iso").max = doc.core_hu;
  byId("iso").value = doc.iso_hu;
  byId("iso-value").textContent = fixed(doc.iso_hu, 0);
  byId("side").value = doc.side;
  const { report } = doc;
  byId("bodies").replaceChildren(...report.bodies.slice(0, 8).map((body) => {
    const item = document.createElement("li");
    item.textContent = `${body.chosen ? "taken: " : ""}${fixed(body.core_mm3 / 1000, 0)} ml around ${point(body.centre_mm, 0)} mm `;
    item.append(button("Show", () => setCursor(transform(inverse(doc.grid.ct_from_voxel), body.centre_mm))));
    return item;
  }));
  facts("skin-facts", [
    ["Limb", `${fixed(report.limb_mm3 / 1000, 0)} ml`],
    ["Couch removed", `${report.couch_voxels} voxels`],
    ["Other removed", `${report.other_voxels} voxels`],
    ["Points of skin", String(report.points)],
    ["Cut by faces", String(report.cut_faces.length)],
  ]);
}

function commandRows(commands) {
  return commands.map((command) => {
    const row = document.createElement("div");
    row.className = "command";
    const code = document.createElement("code");
    code.textContent = command;
    row.append(code, button("Copy", () => navigator.clipboard.writeText(command), `Copy: ${command}`));
    return row;
  });
}

function showCommands() {
  if (store.step === "whatif" || store.step === "room") return;
  byId("command-list").replaceChildren(...commandRows([store.doc.commands.prepare]));
}

async function showImageCommands(values) {
  const commands = await postJson("commands", values);
  if (store.step !== "whatif" && store.step !== "room") return;
  const rows = commandRows([commands.depth, commands.radiograph]);
  if (commands.need_saved_plan) {
    const note = document.createElement("p");
    note.className = "hint";
    note.textContent = "They read the plan that “Save as plan” writes.";
    rows.unshift(note);
  }
  byId("command-list").replaceChildren(...rows);
}

function setCursor(voxel) {
  const { size } = store.doc.grid;
  store.cursor = voxel.map((v, i) => Math.max(0, Math.min(size[i] - 1, v)));
  slices.forEach((view) => view.update());
}

function setWindow(next) {
  store.window = next;
  byId("level").value = next.level;
  byId("width").value = next.width;
  byId("level-value").textContent = fixed(next.level, 0);
  byId("width-value").textContent = fixed(next.width, 0);
  slices.forEach((view) => view.draw());
}

function showReading(reading) {
  byId("pointer").textContent = reading ? `${reading.hu} HU at ${point(reading.place)} mm (LPS), voxel ${reading.voxel.join(", ")}` : "outside the scan";
}

// A click on the surface: a landmark, or the crosshair.
function picked(place) {
  if (store.step === "landmarks" && landmarks.picked(place)) return;
  setCursor(transform(inverse(store.doc.grid.ct_from_voxel), place));
}

function showRoom(next) {
  const first = !room;
  room = next;
  facts("room-facts", [
    ["Gap under the limb", `${fixed(next.contact.gap_mm, 2)} mm`],
    ["Depth in the table", `${fixed(next.contact.penetration_mm, 2)} mm`],
    ["Focal spot to table", `${fixed(next.source[2] - next.table_centre[2], 0)} mm`],
  ]);
  if (store.step !== "room" && store.step !== "whatif") return;
  view3d.worldFromCt = next.room_from_ct;
  const ring = (points) => points.flatMap((p, i) => [p, points[(i + 1) % points.length]]);
  const [w, l] = next.table_size_mm;
  const [x, y, z] = next.table_centre;
  const table = [[x - w / 2, y - 450, z], [x + w / 2, y - 450, z], [x + w / 2, y + l - 450, z], [x - w / 2, y + l - 450, z]];
  view3d.lines = [
    { points: ring(table), colour: "#8c96a3" },
    { points: ring(next.detector), colour: "#7ee787" },
    { points: next.detector.flatMap((corner) => [next.source, corner]), colour: "#ffd479" },
    ...next.cameras.map((camera, i) => ({
      points: [...ring(camera.corners), ...camera.corners.flatMap((corner) => [camera.centre, corner])],
      colour: ["#6cb6ff", "#ff7ad9"][i],
    })),
  ];
  view3d.points = [
    { points: [next.source], colour: "#ffd479" },
    { points: next.cameras.map((camera) => camera.centre), colour: "#ffffff" },
  ];
  if (first) view3d.frame(next.table_centre, 3200);
  else view3d.draw();
}

function go(step) {
  store.step = step;
  document.body.dataset.step = step;
  for (const tab of document.querySelectorAll("[role=tab]")) {
    const chosen = tab.dataset.step === step;
    tab.setAttribute("aria-selected", String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
  }
  if (location.hash.slice(1) !== step) history.pushState(null, "", `#${step}`);
  if (!store.doc) return;
  showCommands();
  slices.forEach((view) => view.update());
  if (step === "room" || step === "whatif") {
    room = null;
    whatIf.changed();
  } else {
    whatIf.cancelRadiograph();
    const moved = view3d.worldFromCt !== IDENTITY;
    drawLandmarks();
    if (moved) view3d.frame();
  }
}

function stepInAddress() {
  const step = location.hash.slice(1);
  return STEPS.includes(step) ? step : "scan";
}

function listen() {
  const tabs = [...document.querySelectorAll("[role=tab]")];
  for (const [i, tab] of tabs.entries()) {
    tab.addEventListener("click", () => go(tab.dataset.step));
    tab.addEventListener("keydown", (event) => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!by) return;
      const next = tabs[(i + by + tabs.length) % tabs.length];
      next.focus();
      go(next.dataset.step);
    });
  }
  window.addEventListener("popstate", () => go(stepInAddress()));
  byId("undo").addEventListener("click", () => change("undo"));
  byId("redo").addEventListener("click", () => change("redo"));
  byId("save").addEventListener("click", () => {
    const { is_saved, original } = store.doc.files;
    if (!is_saved || window.confirm(`Replace ${original} with the changed case?`)) change("save");
  });
  document.addEventListener("keydown", (event) => {
    if (!event.ctrlKey || event.target.matches("input[type=number]")) return;
    if (event.key === "z" && store.doc?.can_undo) change("undo");
    if (event.key === "y" && store.doc?.can_redo) change("redo");
  });
  byId("level").addEventListener("input", (event) => setWindow({ ...store.window, level: Number(event.target.value) }));
  byId("width").addEventListener("input", (event) => setWindow({ ...store.window, width: Number(event.target.value) }));
  const follow = newest(showSurfaceAt);
  byId("iso").addEventListener("input", (event) => {
    byId("iso-value").textContent = event.target.value;
    follow(Number(event.target.value));
  });
  byId("iso").addEventListener("change", (event) => change("surface", { iso_hu: Number(event.target.value) }));
  byId("side").addEventListener("change", (event) => change("surface", { side: event.target.value }));
  byId("show-removed").addEventListener("change", (event) => {
    store.showRemoved = event.target.checked;
    slices.forEach((view) => view.draw());
  });
  for (const [name, level, width] of WINDOWS) byId("windows").append(button(name, () => setWindow({ level, width })));
  for (const canvas of document.querySelectorAll("canvas")) canvas.addEventListener("contextmenu", (event) => event.preventDefault());
}

listen();
setWindow(store.window);
go(stepInAddress());
getJson("state").then(show).catch(fail);
