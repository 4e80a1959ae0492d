// Training runs: progress, overlaid curves, errors, and the images with the largest errors.

import { Refused, getJson, postJson } from "/page/server.js";
import { button, commandRows, element, table } from "/page/elements.js";
import { MOST_SERIES, ROTATION, chart, mark, styleOf } from "/page/charts.js";
import { fixed } from "/page/geometry.js";

const byId = (id) => document.getElementById(id);

// Polling interval of active training runs, ms.
const POLL_MS = 2000;

// Age of the log above which a training run counts as stopped, s.
const SILENT_S = 900;

// Maximum number of listed training runs; the filter finds the others.
const LISTED = 100;

const CURVES = [
  { tag: "training/loss", title: "Loss of the training batches", y: "mean squared error" },
  { tag: "evaluation/mae", title: "MAE of the evaluation images", y: "MAE" },
  { tag: "training/mae", title: "MAE of training images", y: "MAE" },
  { tag: "evaluation/r_s", title: "Spearman correlation of the evaluation images", y: "r_s" },
  { tag: "evaluation/correction_mae_deg", title: "MAE of the correction", y: "degrees" },
  { tag: "training/rate", title: "Learning rate", y: "learning rate" },
];

const number = (value, digits = 3) => (typeof value === "number" ? fixed(value, digits) : "–");
const percent = (value) => (typeof value === "number" ? `${fixed(100 * value, 1)} %` : "–");
const runs = ({ finished, silent_s }) => !finished && silent_s !== null && silent_s < SILENT_S;

function span(seconds) {
  return seconds < 5400 ? `${fixed(seconds / 60, 0)} min` : `${fixed(seconds / 3600, 1)} h`;
}

function state(training) {
  if (training.error) return training.error;
  if (training.finished) return "finished";
  if (training.silent_s === null) return "not started";
  return runs(training) ? "running" : `stopped ${span(training.silent_s)} ago`;
}

export class TrainingPanel {
  constructor(actions) {
    this.actions = actions;
    this.trainings = [];
    this.chosen = null;
    this.logs = new Map();
    this.errors = new Map();
    byId("training-refresh").addEventListener("click", () => this.show());
    byId("training-filter").addEventListener("input", () => this.table());
  }

  // Shows or refreshes the step.
  async show() {
    clearTimeout(this.timer);
    this.visible = true;
    try {
      const { folder, trainings, watch } = await getJson("trainings");
      if (!this.visible) return;
      byId("training-folder").textContent = folder === "." ? "this folder" : folder;
      this.trainings = trainings;
      this.watch = watch;
      // Initially chooses the most recently written runs.
      const latest = [...trainings].sort((a, b) => (a.silent_s ?? Infinity) - (b.silent_s ?? Infinity));
      this.chosen ??= latest.slice(0, 4).map(({ name }) => name).sort();
      this.chosen = this.chosen.filter((name) => trainings.some((one) => one.name === name));
      byId("training-refused").textContent = "";
      this.table();
      await this.curves();
    } catch (error) {
      this.refused(error);
    }
    if (!this.visible) return;
    clearTimeout(this.timer);
    if (this.trainings.some(runs)) this.timer = setTimeout(() => this.show(), POLL_MS);
  }

  hide() {
    this.visible = false;
    clearTimeout(this.timer);
  }

  style(name) {
    return styleOf(this.chosen.indexOf(name));
  }

  table() {
    const text = byId("training-filter").value;
    const found = this.trainings.filter(({ name }) => name.includes(text));
    const finished = this.trainings.filter((one) => one.finished).length;
    const count = `${found.length} of ${this.trainings.length} training runs, ${finished} finished, ${this.trainings.filter(runs).length} running`;
    if (byId("training-count").textContent !== count) byId("training-count").textContent = count;
    this.commands();
    // An unchanged table is not redrawn and so keeps the focus.
    const shown = JSON.stringify([found.slice(0, LISTED).map((one) => [one.name, one.step, one.rows, state(one)]), found.length, this.chosen]);
    if (shown === this.shown) return;
    this.shown = shown;
    const focused = document.activeElement?.id;
    const rows = found.slice(0, LISTED).map((training) => this.row(training));
    const none = element("p", this.trainings.length ? "No name contains this text." : "There are no training runs here. “ppa train” starts one; “ppa studio FOLDER” opens a folder of runs.", { class: "hint" });
    byId("training-table").replaceChildren(rows.length ? table(["Training", "Steps", "Loss", "MAE", "r_s", "State", "Errors"], rows) : none);
    if (found.length > LISTED) byId("training-table").append(element("p", `and ${found.length - LISTED} more: type part of their names on the right`, { class: "hint" }));
    if (focused?.startsWith("training-of-")) byId(focused)?.focus();
  }

  // Shows the commands of the chosen runs; leaves the commands of other steps.
  commands() {
    if (!this.visible) return;
    const chosen = this.trainings.filter(({ name, command }) => command && this.chosen.includes(name)).map(({ command }) => command);
    const all = this.watch ? [this.watch, ...chosen] : chosen;
    const rows = all.length ? all : ["ppa train train.toml --out run"];
    const before = [...byId("command-list").querySelectorAll("code")].map((code) => code.textContent);
    if (before.join("\n") !== rows.join("\n")) byId("command-list").replaceChildren(...commandRows(rows));
  }

  row(training) {
    const { name, step, steps, last, finished, error } = training;
    const choice = element("input", "", { type: "checkbox", id: `training-of-${name}` });
    choice.checked = this.chosen.includes(name);
    choice.disabled = !choice.checked && this.chosen.length >= MOST_SERIES;
    choice.addEventListener("change", () => this.choose(choice.checked ? [...this.chosen, name] : this.chosen.filter((other) => other !== name)));
    const label = element("label", ` ${name}`, { for: choice.id });
    if (choice.checked) label.prepend(" ", mark(this.style(name)));
    const first = element("span");
    first.append(choice, label);
    let errors = "";
    if (finished && !error) {
      errors = button("Errors", () => this.predict(name), `Errors of ${name}`);
      errors.id = `training-of-${name}-errors`;
    }
    return [first, `${step} of ${steps || "?"}`, number(last["training/loss"], 4), number(last["evaluation/mae"]), number(last["evaluation/r_s"]), state(training), errors];
  }

  async choose(names) {
    this.chosen = names;
    this.table();
    this.drawErrors();
    try {
      await this.curves();
    } catch (error) {
      this.refused(error);
    }
  }

  // Logs are read again only while they grow.
  async curves() {
    for (const name of this.chosen) {
      const { step, rows } = this.trainings.find((one) => one.name === name);
      const length = `${step} ${rows}`;
      if (this.logs.get(name)?.length === length) continue;
      this.logs.set(name, { length, rows: await getJson(`training/log?run=${encodeURIComponent(name)}`) });
    }
    const drawn = CURVES.flatMap(({ tag, title, y }) => {
      const series = this.chosen.map((name) => ({
        style: this.style(name),
        points: (this.logs.get(name)?.rows ?? []).filter((row) => typeof row[tag] === "number").map((row) => ({ x: row.step, y: row[tag] })),
      }));
      return this.figure(title, { x: "step", y }, series);
    });
    byId("training-charts").replaceChildren(...drawn);
  }

  figure(title, axes, series, range) {
    const drawn = series.filter(({ points }) => points.length > 0);
    if (drawn.length === 0) return [];
    const figure = element("figure", "", { class: "chart" });
    figure.append(chart(title, axes, drawn, range), element("figcaption", title));
    return [figure];
  }

  async predict(name) {
    this.actions.tell(`predicting the evaluation images of ${name} …`);
    try {
      this.errors.set(name, await postJson("training/errors", { run: name }));
      this.worstOf = name;
      // At the limit, drops the run that was chosen last.
      if (!this.chosen.includes(name)) await this.choose([...this.chosen.slice(0, MOST_SERIES - 1), name]);
      this.drawErrors();
      if (!this.visible) return;
      this.actions.tell("");
      byId("training-errors").scrollIntoView({ block: "start" });
    } catch (error) {
      // A later request replaced this one.
      if (error.status !== 409) this.actions.fail(error);
    }
  }

  // Draws the chosen runs whose errors are known.
  drawErrors() {
    const known = this.chosen.filter((name) => this.errors.has(name));
    byId("training-errors").hidden = known.length === 0;
    if (known.length === 0) return;
    const rows = known.map((name) => {
      const { n, mae, spearman, accuracy, diagnostic_accuracy, sensitivity, specificity } = this.errors.get(name).evaluation.images;
      const first = element("span", ` ${name}`);
      first.prepend(mark(this.style(name)));
      return [first, String(n), number(mae), number(spearman), ...[accuracy, diagnostic_accuracy, sensitivity, specificity].map(percent)];
    });
    byId("error-table").replaceChildren(table(["Training", "Images", "MAE", "r_s", "Accuracy", "Diagnostic", "Sensitivity", "Specificity"], rows));
    const curve = (key) => known.map((name) => ({
      style: this.style(name),
      points: this.errors.get(name).evaluation[key].map(([x, y]) => ({ x, y })),
    }));
    byId("error-charts").replaceChildren(
      ...this.figure("Mean absolute error by angle", { x: ROTATION, y: "MAE" }, curve("error_by_angle")),
      ...this.figure("Mean prediction by label", { x: "label", y: "prediction" }, curve("calibration"), [0.8, 3.2]),
    );
    this.drawWorst(known.includes(this.worstOf) ? this.worstOf : known[0]);
  }

  drawWorst(name) {
    byId("worst-of").textContent = name;
    // Each computation uses a new URL, since it may find other images.
    this.drawn = (this.drawn ?? 0) + 1;
    byId("worst").replaceChildren(...this.errors.get(name).worst.map((row, index) => {
      const figure = element("figure");
      const what = `patient ${row.patient} ${row.side === "l" ? "left" : "right"}${row.angle_deg === null ? "" : `, ${fixed(row.angle_deg)}°`}, ${row.pose}`;
      const image = element("img", "", { src: `/api/training/image/${index}?run=${encodeURIComponent(name)}&drawn=${this.drawn}`, alt: `Depth image of ${what}`, loading: "lazy" });
      figure.append(image, element("figcaption", `${what}: label ${fixed(row.label, 2)}, predicted ${fixed(row.prediction, 2)}`));
      return figure;
    }));
  }

  refused(error) {
    if (!(error instanceof Refused)) this.actions.fail(error);
    byId("training-refused").textContent = error.message;
  }
}
