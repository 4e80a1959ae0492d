// The dataset: quality of its poses, with filters, outliers, images of a pose, findings and splits.

import { Refused, getBytes, getJson, newest, postJson } from "/page/server.js";
import { button, commandRows, element, table } from "/page/elements.js";
import { MOST_SERIES, ROTATION, chart, mark, styleOf } from "/page/charts.js";
import { fixed } from "/page/geometry.js";

const byId = (id) => document.getElementById(id);

// Maximum number of listed outliers and flaws.
const LISTED = 50;

const CHARTS = [
  { title: "Height of the joint above the table", unit: "mm", of: (pose) => pose.height_mm, odd: "height of the joint" },
  { title: "Tilt of the axis", unit: "degrees", of: (pose) => pose.tilt_deg, odd: "tilt of the axis" },
  { title: "Label, with its spread", unit: "1 ideal, 3 inadequate", of: (pose) => pose.label?.label, spread: (pose) => pose.label.std, range: [0.8, 3.2], once: true },
  { title: "Largest share of a region that is cut", unit: "%", of: (pose) => 100 * pose.cut_share, from0: true },
];

const limbName = ({ patient, side }) => `patient ${patient} ${side === "l" ? "left" : "right"}`;
const limbKey = ({ patient, side }) => `${patient}/${side}`;
const poseName = (pose) => `${limbName(pose)}, ${pose.shape}, ${fixed(pose.angle_deg)}°`;

export class DatasetPanel {
  constructor(actions) {
    this.actions = actions;
    this.found = null;
    // Shows the images of a pose.
    this.show = newest((pose) => this.put(pose));
    for (const id of ["filter-limb", "filter-shape", "filter-from", "filter-to"]) byId(id).addEventListener("change", () => this.draw());
    byId("dataset-refresh").addEventListener("click", () => this.load());
    byId("dataset-check").addEventListener("click", () => this.check());
    byId("grading-open").addEventListener("click", () => actions.grade());
    byId("pose-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.nearest();
    });
  }

  async load() {
    const folder = this.actions.folder();
    byId("dataset-name").textContent = folder;
    try {
      this.found = await getJson(`dataset?folder=${encodeURIComponent(folder)}`);
      byId("dataset-refused").textContent = "";
      byId("dataset-absent").hidden = this.found !== null;
    } catch (error) {
      // A later request replaced this one.
      if (error.status === 409) return;
      this.found = null;
      byId("dataset-absent").hidden = true;
      if (!(error instanceof Refused)) this.actions.fail(error);
      byId("dataset-refused").textContent = error.message;
    }
    byId("dataset-check").disabled = !this.found;
    byId("dataset-found").hidden = !this.found;
    byId("panel-dataset-found").hidden = !this.found;
    if (!this.found) return;
    const { poses, commands } = this.found;
    byId("command-list").replaceChildren(...commandRows([commands.quality, commands.check]));
    this.choices("filter-limb", "all limbs", new Map(poses.map((pose) => [limbKey(pose), limbName(pose)])));
    this.choices("filter-shape", "all body shapes", new Map(poses.map((pose) => [pose.shape, pose.shape])));
    this.findings();
    this.splits();
    this.draw();
  }

  choices(id, all, names) {
    const select = byId(id);
    const before = select.value;
    select.replaceChildren(new Option(all, ""), ...[...names].map(([value, name]) => new Option(name, value)));
    select.value = names.has(before) ? before : "";
  }

  // Returns the poses that pass the filters.
  chosen() {
    const [limb, shape] = [byId("filter-limb").value, byId("filter-shape").value];
    const end = (id, other) => (byId(id).value === "" ? other : Number(byId(id).value));
    const [from, to] = [end("filter-from", -Infinity), end("filter-to", Infinity)];
    return this.found.poses.filter((pose) => (!limb || limbKey(pose) === limb) && (!shape || pose.shape === shape) && pose.angle_deg >= from && pose.angle_deg <= to);
  }

  draw() {
    const poses = this.chosen();
    const sweeps = Map.groupBy(poses, (pose) => `${limbName(pose)}, ${pose.shape}`);
    const names = [...sweeps.keys()];
    const styles = new Map(names.map((name, number) => [name, styleOf(number)]));
    const legend = names.slice(0, MOST_SERIES).map((name) => {
      const item = element("li", ` ${name}`);
      item.prepend(mark(styles.get(name)));
      return item;
    });
    if (names.length > MOST_SERIES) legend.push(element("li", `and ${names.length - MOST_SERIES} more, which look like these: filter the poses to tell them apart`));
    byId("legend").replaceChildren(...legend);
    byId("charts").replaceChildren(...CHARTS.flatMap((kind) => this.chart(kind, sweeps, styles)));
    const odd = poses.filter((pose) => pose.stands_out.length > 0);
    const labelled = poses.filter((pose) => pose.label).length;
    byId("dataset-count").textContent = `${poses.length} of ${this.found.poses.length} poses, ${labelled} with a label, ${odd.length} outlier${odd.length === 1 ? "" : "s"}`;
    this.outliers(odd);
  }

  chart({ title, unit, of, odd, spread, range, once, from0 }, sweeps, styles) {
    const limbs = new Set();
    const series = [...sweeps].flatMap(([name, poses]) => {
      const limb = limbKey(poses[0]);
      // Labels are the same for all body shapes.
      if (once && limbs.has(limb)) return [];
      limbs.add(limb);
      const points = poses.filter((pose) => of(pose) !== undefined).map((pose) => ({
        x: pose.angle_deg, y: of(pose), spread: spread?.(pose), ringed: odd && pose.stands_out.includes(odd), of: pose,
      }));
      return points.length ? [{ style: styles.get(name), points }] : [];
    });
    const largest = Math.max(0, ...series.flatMap((one) => one.points.map((p) => p.y)));
    if (series.length === 0 || (from0 && largest === 0)) return [];
    const figure = element("figure", "", { class: "chart" });
    figure.append(chart(title, { x: ROTATION, y: unit }, series, from0 ? [0, 1.1 * largest] : range, (pose) => this.show(pose)), element("figcaption", title));
    return [figure];
  }

  outliers(odd) {
    const items = odd.slice(0, LISTED).map((pose) => {
      const item = element("li", `${poseName(pose)}: ${pose.stands_out.join(", ")} `, { class: "caution" });
      item.append(button("Show", () => this.show(pose), `Show ${poseName(pose)}`));
      return item;
    });
    if (odd.length > LISTED) items.push(element("li", `and ${odd.length - LISTED} more`));
    if (items.length === 0) items.push(element("li", "none"));
    byId("outliers").replaceChildren(...items);
  }

  findings() {
    const items = this.found.findings.map((finding) => element("li",
      `${limbName(finding)}: ${finding.severity} [${finding.code}] ${finding.text}${finding.acknowledged ? " (acknowledged)" : ""}`, { class: finding.severity }));
    byId("dataset-findings").replaceChildren(...(items.length ? items : [element("li", "none")]));
  }

  splits() {
    const rows = this.found.splits.map(({ name, parts, error }) => [name, error ?? parts.map(([part, patients]) => `${part}: ${patients.join(", ")}`).join("; ")]);
    byId("splits").replaceChildren(rows.length ? table(["Split", "Persons"], rows) : element("p", "none"));
  }

  // Shows the filtered pose nearest to an angle.
  nearest() {
    const wanted = Number(byId("pose-angle").value);
    const [first, ...others] = this.chosen();
    if (!first) return;
    this.show(others.reduce((best, pose) => (Math.abs(pose.angle_deg - wanted) < Math.abs(best.angle_deg - wanted) ? pose : best), first));
  }

  async put(pose) {
    const query = `?folder=${encodeURIComponent(this.actions.folder())}`;
    byId("pose").hidden = false;
    byId("pose-name").textContent = poseName(pose);
    const label = pose.label ? `, label ${fixed(pose.label.label, 2)} ± ${fixed(pose.label.std, 2)} (${pose.label.source ?? "source not named"})` : "";
    const odd = pose.stands_out.length ? `; outlier of the ${pose.stands_out.join(" and the ")}` : "";
    byId("pose-facts").textContent = `joint ${fixed(pose.height_mm)} mm above the table, tilt ${fixed(pose.tilt_deg, 2)}°${label}${odd}`;
    byId("pose-open").replaceChildren(...this.openers(pose));
    await Promise.all([
      this.picture("pose-depth", `dataset/depth/${limbKey(pose)}/${pose.shape}/${pose.step}${query}`),
      this.picture("pose-radiograph", `dataset/radiograph/${limbKey(pose)}/${pose.step}${query}`),
    ]);
    byId("pose").dataset.step = pose.step;
    byId("pose").scrollIntoView({ block: "nearest" });
  }

  openers(pose) {
    const { patient, side } = pose;
    if (!this.found.at_hand.some((limb) => limbKey(limb) === limbKey(pose))) {
      return [element("p", "There is no plan with the case of this limb next to the dataset, so the pose cannot be opened in step 5.", { class: "hint" })];
    }
    return [button("Open in step 5", async () => {
      try {
        this.actions.tell("opening the limb …");
        await this.actions.opened(await postJson("dataset/open", { patient, side }), pose.angle_deg);
      } catch (error) {
        this.actions.fail(error);
      }
    })];
  }

  async picture(id, path) {
    const image = byId(id);
    const before = image.src;
    try {
      image.src = URL.createObjectURL(new Blob([await getBytes(path)], { type: "image/png" }));
      image.hidden = false;
    } catch (error) {
      image.hidden = true;
      this.actions.fail(error);
    }
    if (before) URL.revokeObjectURL(before);
  }

  // Slow: decodes all images.
  async check() {
    byId("check-text").textContent = "decoding all images …";
    try {
      const { depth_images, radiographs, flaws } = await postJson("dataset/check", { folder: this.actions.folder() });
      byId("check-text").textContent = `${depth_images} depth images and ${radiographs} radiographs decoded, ${flaws.length || "no"} flaw${flaws.length === 1 ? "" : "s"}`;
      byId("flaws").replaceChildren(...flaws.slice(0, LISTED).map((flaw) => element("li", flaw, { class: "severe" })));
    } catch (error) {
      if (error.status === 409) return;
      byId("check-text").textContent = "";
      this.actions.fail(error);
    }
  }
}
