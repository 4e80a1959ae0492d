// Sliders for pose and exposure, and the images that follow them.

import { Refused, newest, post, postJson, postPicture } from "/page/server.js";
import { facts } from "/page/elements.js";
import { CameraForm } from "/page/cameras.js";
import { DoseTable } from "/page/dose.js";
import { fixed } from "/page/geometry.js";

const byId = (id) => document.getElementById(id);

// Delay from the last change to the start of a radiograph, ms.
const SETTLED_MS = 250;

const SLIDERS = [
  { key: "angle_deg", label: "Medial rotation", unit: "°", min: -30, max: 120, step: 0.5, start: 0 },
  { key: "distal_mm", label: "Heel sinks in", unit: " mm", min: 0, max: 20, step: 0.5 },
  { key: "proximal_mm", label: "Calf sinks in", unit: " mm", min: 0, max: 20, step: 0.5 },
  { key: "tilt_deg", label: "Tilt (above 0: proximal end up)", unit: "°", min: -45, max: 45, step: 0.5, start: 0 },
  { key: "beam_along_mm", label: "Beam towards the head", unit: " mm", min: -300, max: 300, step: 1, start: 0 },
  { key: "beam_across_mm", label: "Beam towards the patient's left", unit: " mm", min: -300, max: 300, step: 1, start: 0 },
  { key: "kvp", label: "Tube voltage", unit: " kV", min: 40, max: 120, step: 1 },
  { key: "aluminium_mm", label: "Aluminium", unit: " mm", min: 0, max: 10, step: 0.1 },
  { key: "mas", label: "Tube load", unit: " mAs", min: 0.1, max: 20, step: 0.1 },
];

// Sliders of the tube.
const OF_EXPOSURE = ["kvp", "aluminium_mm", "mas"];

const gutterText = (gutter) => `${gutter.name} gutter ${fixed(100 * gutter.openness, 0)} % open, grade ${fixed(gutter.grade)}`;

const TECHNIQUES = ["ankle", "knee", "lower-leg", "foot", "hand", "wrist", "elbow"];

const VERDICTS = { yes: "diagnostic", no: "not diagnostic", not_sure: "not sure whether diagnostic" };

// Whether a request failed because a later one replaced it.
const isReplaced = (error) => error instanceof Refused && error.status === 409;

// Describes the networks' answer for the depth images; "" if no networks are open.
function networkText(answer) {
  if (!answer) return "";
  if (answer.refused) return `Networks: no answer, since ${answer.refused}`;
  const { quality, left, right, interval, diagnostic, correction_deg } = answer.prediction;
  const parts = [VERDICTS[diagnostic ?? (quality < 2.5 ? "yes" : "no")]];
  if (interval) parts.push(`interval ${fixed(interval[0])} to ${fixed(interval[1])}`);
  if (left !== undefined) parts.push(`left camera ${fixed(left)}`, `right camera ${fixed(right)}`);
  if (correction_deg !== undefined) parts.push(`best after ${fixed(Math.abs(correction_deg), 0)}° more of ${correction_deg < 0 ? "lateral" : "medial"} rotation`);
  return `Networks ${fixed(quality)}: ${parts.join(", ")}`;
}

export class WhatIfPanel {
  constructor(store, actions) {
    this.store = store;
    this.actions = actions;
    this.values = { angle_deg: 0 };
    this.sliders = [];
    this.sensor = false;
    this.grid = null;
    this.technique = null;
    this.shape = null;
    this.sweeping = false;
    this.depths = newest((whatIf) => this.depth(whatIf));
    this.rooms = newest((whatIf) => this.room(whatIf));
    this.labels = newest((whatIf) => this.label(whatIf));
    this.coverages = newest((whatIf) => this.coverage(whatIf));
    this.cameras = new CameraForm(() => this.changed());
    this.dose = new DoseTable({ whatIf: () => this.whatIf(), failed: (error) => this.failed(error) });
    this.build();
    byId("sweep").addEventListener("click", () => this.sweep());
    for (const id of ["save-plan", "room-save-plan"]) byId(id).addEventListener("click", () => this.save("plan", false));
    byId("cameras-save").addEventListener("click", () => this.save("cameras", false));
  }

  build() {
    const form = byId("whatif-form");
    form.addEventListener("submit", (event) => event.preventDefault());
    for (const slider of SLIDERS) form.append(this.slider(slider));
    form.append(this.select("shape", "Body shape that the cameras see", [["", "that of the scan"], ["big", "big"], ["small", "small"], ["bumps_a", "bumps a"], ["bumps_b", "bumps b"]], (value) => { this.shape = value || null; }));
    form.append(this.select("technique", "Technique", [["", "that of the plan"], ...TECHNIQUES.map((name) => [name, name.replace("-", " ")])], (value) => { this.technique = value || null; }));
    form.append(this.select("grid", "Anti-scatter grid", [["", "that of the plan"], ["yes", "8:1, 40 lines per cm"], ["no", "none"]],
      (value) => { this.grid = value === "" ? null : value === "yes"; }));
    const label = document.createElement("label");
    label.className = "check";
    const box = document.createElement("input");
    box.type = "checkbox";
    box.id = "sensor";
    box.addEventListener("change", () => { this.sensor = box.checked; this.changed(); });
    label.append(box, " Errors of a Time-of-Flight sensor");
    form.append(label);
  }

  // Makes a slider, which shows the value of the technique or the plan until it is moved.
  slider({ key, label, unit, min, max, step, start }) {
    const row = document.createElement("div");
    row.className = "row";
    const name = document.createElement("label");
    name.htmlFor = `slider-${key}`;
    const output = document.createElement("output");
    const input = document.createElement("input");
    Object.assign(input, { type: "range", id: name.htmlFor, min, max, step, value: start ?? min });
    const show = () => {
      const value = this.values[key];
      const planned = this.planned(key);
      if (value === undefined && planned !== undefined) input.value = planned;
      const shown = value ?? planned;
      const text = shown === undefined ? this.otherwise(key) : `${fixed(shown, step < 1 ? 1 : 0)}${unit}`;
      const source = this.technique && OF_EXPOSURE.includes(key) ? "technique" : "plan";
      output.textContent = value === undefined ? `${text}, from the ${source}` : text;
    };
    this.sliders.push(show);
    input.addEventListener("input", () => {
      this.values[key] = Number(input.value);
      show();
      this.changed();
    });
    this.setAngle ??= (angle) => { input.value = angle; this.values[key] = angle; show(); };
    name.append(`${label} `, output);
    row.append(name, input);
    show();
    return row;
  }

  // Returns the exposure of the technique or the plan.
  exposure() {
    const planned = this.store.doc?.planned;
    return planned?.techniques[this.technique] ?? planned?.exposure;
  }

  // Returns the value of the technique or the plan, if it is a number for a slider.
  planned(key) {
    const exposure = this.exposure();
    if (!exposure) return undefined;
    if (!OF_EXPOSURE.includes(key)) return this.store.doc.planned[key];
    if (key === "kvp") return exposure.kvp;
    if (key === "mas") return exposure.tube_load?.mas;
    const [only, ...others] = exposure.filters;
    if (!only) return 0;
    return others.length === 0 && only.startsWith("Al:") ? Number(only.slice(3)) : undefined;
  }

  // Describes filters or a tube load that no slider shows.
  otherwise(key) {
    const exposure = this.exposure();
    if (key === "aluminium_mm") return exposure?.filters.join(", ") ?? "";
    return exposure?.tube_load ? "set by the exposure index" : "set by the histories";
  }

  show() {
    this.sliders.forEach((show) => show());
  }

  select(id, label, options, set) {
    const row = document.createElement("div");
    row.className = "row";
    const name = document.createElement("label");
    name.htmlFor = id;
    name.textContent = label;
    const input = document.createElement("select");
    input.id = id;
    for (const [value, text] of options) input.append(new Option(text, value));
    input.addEventListener("change", () => { set(input.value); this.show(); this.changed(); });
    row.append(name, input);
    return row;
  }

  whatIf() {
    const { aluminium_mm, ...values } = this.values;
    const whatIf = { ...values, sensor: this.sensor };
    if (aluminium_mm !== undefined) whatIf.filters = aluminium_mm > 0 ? [`Al:${aluminium_mm}`] : [];
    if (this.shape) whatIf.shape = this.shape;
    if (this.technique) whatIf.technique = this.technique;
    if (this.grid !== null) whatIf.grid = this.grid;
    const cameras = this.cameras.moves();
    if (cameras) whatIf.cameras = cameras;
    return whatIf;
  }

  isShown() {
    return this.store.step === "whatif" || this.store.step === "room";
  }

  // Updates everything that depends on pose or exposure.
  changed() {
    if (!this.store.doc || !this.isShown()) return;
    this.cancelRadiograph();
    const whatIf = this.whatIf();
    this.depths(whatIf);
    this.rooms(whatIf);
    this.actions.commands(whatIf);
    if (this.sweeping) return;
    this.timer = setTimeout(() => {
      if (this.store.step === "room") return this.coverages(whatIf);
      this.labels(whatIf);
      this.radiograph(whatIf);
    }, SETTLED_MS);
  }

  cancelRadiograph() {
    clearTimeout(this.timer);
    this.exposing?.abort();
    this.exposing = null;
    this.dose.clear();
  }

  async depth(whatIf) {
    const started = performance.now();
    try {
      const { picture, report } = await postPicture("depth", whatIf);
      await this.put("depth", picture);
      byId("network").textContent = networkText(report.network);
      this.actions.prediction(report.network_command);
      const ms = Math.round(performance.now() - started);
      byId("depth").querySelector("figcaption").textContent =
        `left and right camera, ${fixed(report.range_mm[0], 0)} (red) to ${fixed(report.range_mm[1], 0)} mm or more (blue), ${ms} ms`;
    } catch (error) {
      this.failed(error);
    }
  }

  async room(whatIf) {
    try {
      const room = await postJson("room", whatIf);
      this.actions.room(room, this.cameras.handles(room, whatIf.cameras));
    } catch (error) {
      this.failed(error);
    }
  }

  // Shows both cameras' coverage of the skin near the joint.
  async coverage(whatIf) {
    try {
      const { places, radius_mm, max_angle_deg } = await postJson("coverage", whatIf);
      const row = (camera) => {
        const { visible_share, mm_per_pixel } = places.find(({ name }) => name === `rig cam_${camera}`);
        const size = mm_per_pixel ? `, ${fixed(mm_per_pixel, 1)} mm a pixel` : "";
        return [`Seen by the ${camera} one`, `${fixed(100 * visible_share, 0)} %${size}`];
      };
      facts(byId("coverage"), [row("left"), row("right"), ["of the skin", `within ${fixed(radius_mm, 0)} mm of the joint, at most ${fixed(max_angle_deg, 0)}° oblique`]]);
    } catch (error) {
      this.failed(error);
    }
  }

  // Shows the computed label; there is none if the case has no bones.
  async label(whatIf) {
    try {
      const label = await postJson("label", whatIf);
      byId("label").textContent = label
        ? `Computed label ${fixed(label.label)} ± ${fixed(label.std)} (${label.label < 2.5 ? "diagnostic" : "not diagnostic"}): ${label.gutters.map(gutterText).join(", ")}`
        : "No computed label: the case does not specify bones (ppa prepare --bones or --segment-bones)";
    } catch (error) {
      this.failed(error);
    }
  }

  // Shows a first radiograph within a second, then the final one.
  async radiograph(whatIf) {
    const exposing = new AbortController();
    this.exposing = exposing;
    const started = performance.now();
    try {
      for (const pass of ["first", "final"]) {
        byId("radiograph").querySelector("figcaption").textContent = pass === "first" ? "simulating …" : "first image; simulating all pixels …";
        const { picture, report } = await postPicture(`radiograph/${pass}`, whatIf, exposing.signal);
        await this.put("radiograph", picture);
        const seconds = (performance.now() - started) / 1000;
        this.showReport(pass, report, seconds);
        if (pass === "final" && !exposing.signal.aborted) this.dose.offer(report.mas);
      }
    } catch (error) {
      if (exposing.signal.aborted) return;
      byId("radiograph").querySelector("figcaption").textContent = isReplaced(error) ? "not finished: another request replaced it" : "";
      this.failed(error);
    }
  }

  showReport(pass, report, seconds) {
    const parts = [`${pass} image in ${fixed(seconds)} s`];
    if (report.mas) parts.push(`${fixed(report.mas, 2)} mAs`);
    if (report.entrance_air_kerma_ugy) parts.push(`${fixed(report.entrance_air_kerma_ugy, 0)} µGy at the skin`);
    if (report.exposure_index) parts.push(`exposure index ${fixed(report.exposure_index, 0)}`);
    byId("radiograph").querySelector("figcaption").textContent = parts.join(", ");
    byId("radiograph").dataset.pass = pass;
  }

  async put(id, picture) {
    const image = byId(id).querySelector("img");
    const before = image.src;
    image.src = URL.createObjectURL(picture);
    try { await image.decode(); } catch { /* replaced meanwhile */ }
    if (before) URL.revokeObjectURL(before);
  }

  // A request replaced by a later one is not a failure.
  failed(error) {
    if (!isReplaced(error)) this.actions.fail(error);
  }

  // Shows all angles from 0 to 90 degrees, each as soon as the previous one is shown.
  async sweep() {
    this.sweeping = !this.sweeping;
    byId("sweep").textContent = this.sweeping ? "Stop" : "Play 0 to 90°";
    if (!this.sweeping) return;
    this.cancelRadiograph();
    const started = performance.now();
    let frames = 0;
    for (let angle = 0; angle <= 90 && this.sweeping; angle += 1) {
      this.setAngle(angle);
      await this.depth(this.whatIf());
      frames += 1;
    }
    const rate = 1000 * frames / (performance.now() - started);
    byId("whatif-facts").textContent = `${fixed(rate)} pairs of depth images per second`;
    this.sweeping = false;
    byId("sweep").textContent = "Play 0 to 90°";
    this.changed();
  }

  // Saves the displayed plan or cameras.
  async save(what, replace) {
    try {
      const response = await post(what, { what_if: this.whatIf(), replace });
      this.actions.tell(`Saved ${(await response.json()).file}`);
      this.actions.commands(this.whatIf());
    } catch (error) {
      if (error instanceof Refused && error.status === 409 && !replace && window.confirm(`${error.message}. Replace it?`)) {
        return this.save(what, true);
      }
      this.actions.fail(error);
    }
  }
}
