// The page: one store, one place that changes it, and views that follow.

import { getJson, inTurn, newest, onAnswer, postJson } from "/page/server.js";
import { fixed, inverse, point, transform, IDENTITY } from "/page/geometry.js";
import { SliceView } from "/page/slices.js";
import { surfaceAt } from "/page/surface.js";
import { ShapePanel } from "/page/shape.js";
import { View3d } from "/page/view3d.js";
import { LandmarkPanel } from "/page/landmarks.js";
import { WhatIfPanel } from "/page/whatif.js";
import { PlanPanel } from "/page/plan.js";
import { GenerationPanel } from "/page/generation.js";
import { DatasetPanel } from "/page/dataset.js";
import { GradingPanel } from "/page/grading.js";
import { TrainingPanel } from "/page/training.js";
import { LivePanel } from "/page/live.js";
import { Bodies } from "/page/bodies.js";
import { CropPanel, cropOf } from "/page/crop.js";
import { CutPanel } from "/page/cuts.js";
import { showScan, showSkin } from "/page/scan.js";
import { drawRoom, roomFacts } from "/page/room.js";
import { button, commandRows } from "/page/elements.js";

const byId = (id) => document.getElementById(id);
const STEPS = ["scan", "skin", "landmarks", "room", "whatif", "generation", "dataset", "grading", "training"];
// Steps that show the limb.
const OF_LIMB = STEPS.slice(0, 5);
const WINDOWS = [["Soft tissue", 40, 400], ["Bone", 400, 1800], ["Skin", -300, 1200], ["All", 200, 3000]];

const store = { doc: null, step: "scan", cursor: [0, 0, 0], window: { level: 200, width: 1600 }, showRemoved: true, cropping: false, ball: null };

// Makes changes in the order of the user's actions.
const change = inTurn(send);
const actions = { change, choose, crosshair, landmarks: drawLandmarks, crop: (move) => change("surface", (doc) => ({ crop: move && cropOf(doc, move(doc)) })), redraw: () => slices.forEach((view) => view.draw()), cursor: setCursor, place: setPlace, window: setWindow, point: showReading, picked, fail, tell, room: showRoom, commands: newest(showImageCommands), prediction: showPrediction };

const slices = [...document.querySelectorAll(".view[data-axis]")].map((figure) => new SliceView(figure, store, actions));
const view3d = new View3d(byId("view3d"), actions);
const landmarks = new LandmarkPanel(store, actions);
const crop = new CropPanel(store, actions);
const cuts = new CutPanel(store, { crosshair, place: setPlace, redraw: actions.redraw, remove: (removed) => change("surface", (doc) => ({ removed: removed(doc.removed) })) });
const shapes = new ShapePanel(store, { surface: () => showSurface(false).then(() => view3d.draw()).catch(fail) });
const bodies = new Bodies(store, view3d, { change, fail });
const whatIf = new WhatIfPanel(store, actions);
const plan = new PlanPanel({
  fail,
  tell,
  folder: () => generation.show(),
  changed: planChanged,
});
const generation = new GenerationPanel({
  fail,
  tell,
  folder: () => plan.folder(),
  // The plan may have been written to a file now.
  started: () => plan.load(),
});
const datasetFolder = () => opened?.dataset ?? plan.folder();
const dataset = new DatasetPanel({ fail, tell, folder: datasetFolder, opened: openedLimb, grade: () => go("grading") });
const grading = new GradingPanel({ fail });
const training = new TrainingPanel({ fail, tell });
const live = new LivePanel({ fail, folder: () => opened?.watched });
let room = null;
// Whether the view was framed on the open limb.
let framed = false;
// What the program has open: limb, plan, dataset.
let opened = null;

function tell(text) {
  byId("message").className = "quiet";
  byId("message").textContent = text;
}

function fail(error) {
  byId("message").className = "";
  byId("message").textContent = error.message;
}

// Sends a change to the program and shows the result. `body` may be a function of the current state.
async function send(path, body) {
  document.body.setAttribute("aria-busy", "true");
  const slow = setTimeout(() => tell("computing …"), 300);
  try {
    const limb = encodeURIComponent(store.doc.files.original);
    await show(await postJson(`${path}?limb=${limb}`, typeof body === "function" ? body(store.doc) : body));
    tell("");
  } catch (error) {
    fail(error);
    landmarks.show();
    drawLandmarks();
    crop.show();
    slices.forEach((view) => view.draw());
  } finally {
    clearTimeout(slow);
    document.body.removeAttribute("aria-busy");
  }
}

// Sets landmarks chosen by the user; null lets one be found again. Regions and points of the axis exclude each other.
// `chosen` may be a function of the current landmarks.
function choose(chosen) {
  return change("choices", ({ choices: before, landmarks: shown }) => {
    const changes = typeof chosen === "function" ? chosen(shown) : chosen;
    const choices = { ...before, ...changes };
    if (["joint_region", "calf_region", "axis_source"].some((key) => changes[key])) delete choices.axis;
    const given = Object.entries(choices).filter(([, value]) => value !== null && value !== undefined);
    return Object.fromEntries(given);
  });
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
  if (!before) setPlace(doc.landmarks.joint_centre);
  const skinChanged = !before || before.iso_hu !== doc.iso_hu || before.side !== doc.side
    || JSON.stringify(before.report) !== JSON.stringify(doc.report);
  // The landmarks determine the places of bumps.
  const shapeChanged = shapes.asked && JSON.stringify(before?.landmarks) !== JSON.stringify(doc.landmarks);
  if (skinChanged) slices.forEach((view) => view.forget());
  showScan(doc, actions);
  showSkin(doc, actions);
  crop.show();
  cuts.show();
  landmarks.show();
  showCommands();
  slices.forEach((view) => view.update());
  if (skinChanged || shapeChanged) {
    await Promise.all([showSurface(!before), bodies.changed()]);
  }
  drawLandmarks();
  whatIf.show();
  whatIf.changed();
}

async function showSurface(first) {
  if (first) framed = false;
  const surface = await shapes.load();
  if (!surface) return;
  view3d.show(surface);
  if (!framed) view3d.frame();
  framed = true;
}

// Shows everything in the scan at this HU while the slider moves. The limb follows when the slider is released.
async function showSurfaceAt(isoHu) {
  try {
    const surface = await surfaceAt(isoHu);
    if (Number(byId("iso").value) !== store.doc.iso_hu) {
      view3d.showRemoved(null);
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
  view3d.handles = store.step === "landmarks" ? landmarks.handles() : [];
  view3d.draw();
}

function showCommands() {
  if (!["scan", "skin", "landmarks"].includes(store.step)) return;
  byId("command-list").replaceChildren(...commandRows([store.doc.commands.prepare]));
}

// Shows the command of the prediction after those of the images that it reads.
function showPrediction(command) {
  byId("command-list").querySelector(".prediction")?.remove();
  if (!command || store.step !== "whatif") return;
  const [row] = commandRows([command]);
  row.classList.add("prediction");
  byId("command-list").append(row);
}

async function showImageCommands(values) {
  let commands;
  try {
    commands = await postJson("commands", values);
  } catch (error) {
    return fail(error);
  }
  if (store.step !== "whatif" && store.step !== "room") return;
  const rows = commandRows([commands.depth, ...(store.step === "room" ? [commands.coverage] : [commands.radiograph, commands.dose])]);
  if (commands.need_saved_plan) {
    const note = document.createElement("p");
    note.className = "hint";
    note.textContent = "They read the plan that “Save as plan” writes.";
    rows.unshift(note);
  }
  const prediction = store.step === "whatif" ? [...byId("command-list").querySelectorAll(".prediction")] : [];
  byId("command-list").replaceChildren(...rows, ...prediction);
}

function setCursor(voxel) {
  const { size } = store.doc.grid;
  store.cursor = voxel.map((v, i) => Math.max(0, Math.min(size[i] - 1, v)));
  slices.forEach((view) => view.update());
}

// Sets the crosshair to a place in the scan, mm.
function setPlace(place) {
  setCursor(transform(inverse(store.doc.grid.ct_from_voxel), place));
}

// Returns the place of the crosshair in the scan, mm.
function crosshair() {
  return transform(store.doc.grid.ct_from_voxel, store.cursor).map((x) => Math.round(10 * x) / 10);
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

// Handles a click on the surface: a landmark, a body or the crosshair.
function picked(place, inside) {
  if (store.step === "landmarks" && landmarks.picked(place)) return;
  if (bodies.picked(inside)) return;
  setPlace(place);
}

function showRoom(next, handles) {
  const first = !room;
  room = next;
  roomFacts(next);
  if (store.step === "room" || store.step === "whatif") drawRoom(view3d, next, store.step === "room" ? handles : [], first);
}

function go(step) {
  // Scrolls the panel of another step to its top.
  if (store.step !== step) document.querySelector("aside").scrollTop = 0;
  store.step = step;
  bodies.set(false);
  document.body.dataset.step = step;
  for (const tab of document.querySelectorAll("[role=tab]")) {
    const chosen = tab.dataset.step === step;
    tab.setAttribute("aria-selected", String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
  }
  if (location.hash.slice(1) !== step) history.pushState(null, "", `#${step}`);
  if (step !== "generation") generation.hide();
  if (step === "generation") showGeneration();
  if (step === "dataset") showDataset();
  if (step === "grading") showGrading();
  if (step !== "training") {
    training.hide();
    live.hide();
  }
  if (step === "training") showTraining();
  if (!store.doc) return;
  showCommands();
  slices.forEach((view) => view.update());
  if (!shapes.isCurrent()) showSurface(false).then(() => view3d.draw()).catch(fail);
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

async function showGeneration() {
  byId("command-list").replaceChildren();
  await plan.load();
  await generation.show();
}

// Updates forecast and progress and the sliders of step 5 for the changed plan.
async function planChanged() {
  if (store.step === "generation") generation.show();
  if (!store.doc) return;
  try {
    store.doc.planned = (await getJson("state")).planned;
    whatIf.show();
  } catch (error) {
    fail(error);
  }
}

async function showDataset() {
  byId("command-list").replaceChildren();
  if (!opened.dataset && !plan.folder()) await plan.load();
  await dataset.load();
}

async function showGrading() {
  if (!opened.dataset && !plan.folder()) await plan.load();
  grading.show(datasetFolder());
}

async function showTraining() {
  byId("command-list").replaceChildren();
  live.show();
  await training.show();
}

// Shows a limb opened from the dataset in one of its poses.
async function openedLimb(doc, angleDeg) {
  store.doc = null;
  allow({ ...opened, limb: true });
  await show(doc);
  tell("");
  whatIf.setAngle(angleDeg);
  go("whatif");
}

// Disables steps that have nothing to show.
function allow(next) {
  opened = next;
  for (const tab of document.querySelectorAll("[role=tab]")) {
    const { step } = tab.dataset;
    const needs = OF_LIMB.includes(step) ? "limb" : { generation: "plan", dataset: "dataset" }[step];
    tab.disabled = needs === "dataset" ? !opened.dataset && !opened.plan : needs !== undefined && !opened[needs];
    const why = { limb: opened.dataset ? "No limb is open: open one from a pose in step 7" : "No limb is open", plan: "No plan is open", dataset: "No dataset is open" };
    tab.title = tab.disabled ? why[needs] : "";
  }
}

async function begin() {
  allow(await getJson("opened"));
  if (opened.dataset) {
    byId("name").textContent = opened.dataset;
    document.title = `${opened.dataset} - ppa studio`;
  } else if (!opened.limb) {
    byId("name").textContent = opened.watched ?? "Trainings";
  }
  go(stepInAddress());
  if (opened.limb) await show(await getJson("state"));
}

// Called when the program answers again. A restarted program has the saved state.
async function refresh(restarted) {
  try {
    if (restarted) live.forget();
    allow(await getJson("opened"));
    if (opened.limb && store.doc) await show(await getJson("state"));
    go(store.step);
    tell(restarted ? "ppa studio was started again" : "");
  } catch (error) {
    fail(error);
  }
}

// Returns the step in the address, or the first step that has something to show.
function stepInAddress() {
  const step = location.hash.slice(1);
  const needed = step === "grading" ? "dataset" : step;
  if (STEPS.includes(step) && !byId(`tab-${needed}`).disabled) return step;
  if (opened?.limb) return "scan";
  return opened?.dataset ? "dataset" : "training";
}

function listen() {
  const tabs = [...document.querySelectorAll("[role=tab]")];
  for (const tab of tabs) {
    tab.addEventListener("click", () => go(tab.dataset.step));
    tab.addEventListener("keydown", (event) => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!by) return;
      const offered = tabs.filter((one) => !one.disabled);
      const next = offered[(offered.indexOf(tab) + by + offered.length) % offered.length];
      next.focus();
      go(next.dataset.step);
    });
  }
  window.addEventListener("popstate", () => { if (opened) go(stepInAddress()); });
  byId("undo").addEventListener("click", () => change("undo"));
  byId("redo").addEventListener("click", () => change("redo"));
  byId("save").addEventListener("click", () => {
    const { is_saved, original } = store.doc.files;
    if (!is_saved || window.confirm(`Replace ${original} with the changed case?`)) change("save");
  });
  document.addEventListener("keydown", (event) => {
    // In a field, the keys undo what was typed.
    const types = event.target.matches("textarea, input:not([type=range], [type=checkbox])");
    if (!event.ctrlKey || types || !OF_LIMB.includes(store.step)) return;
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
  byId("limb-here").addEventListener("click", () => change("surface", { inside: crosshair() }));
  byId("body-here").addEventListener("click", () => change("body", { point: crosshair() }));
  byId("limb-find").addEventListener("click", () => change("surface", { inside: null }));
  byId("side").addEventListener("change", (event) => change("surface", { side: event.target.value }));
  byId("show-removed").addEventListener("change", (event) => {
    store.showRemoved = event.target.checked;
    bodies.show();
    slices.forEach((view) => view.draw());
  });
  for (const [name, level, width] of WINDOWS) byId("windows").append(button(name, () => setWindow({ level, width })));
  for (const canvas of document.querySelectorAll("canvas")) canvas.addEventListener("contextmenu", (event) => event.preventDefault());
}

listen();
onAnswer(refresh);
setWindow(store.window);
begin().catch(fail);
