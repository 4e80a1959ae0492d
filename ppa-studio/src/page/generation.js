// Forecast, generation, contact sheet and shards of the plan's dataset.

import { Refused, getBytes, getJson, inTurn, post, postJson } from "/page/server.js";
import { commandRows, facts, table } from "/page/elements.js";
import { fixed } from "/page/geometry.js";

const byId = (id) => document.getElementById(id);

// Polling intervals of a run, ms; there is no polling while nothing runs.
const PROGRESS_MS = 1000;
const SHEET_MS = 4000;

const PHASES = {
  absent: "Nothing is made yet.", running: "Being made.", stopping: "Finishing the poses in progress.",
  elsewhere: "Another program is making it.", paused: "Paused.", complete: "Complete.", failed: "Ended early.",
};

const size = (bytes) => (bytes >= 1e9 ? `${fixed(bytes / 1e9)} GB` : `${fixed(bytes / 1e6)} MB`);

function duration(seconds) {
  if (seconds < 90) return `${fixed(seconds, 0)} s`;
  return seconds < 5400 ? `${fixed(seconds / 60, 0)} min` : `${fixed(seconds / 3600)} h`;
}

export class GenerationPanel {
  constructor(actions) {
    this.actions = actions;
    this.state = null;
    this.sheetOf = null;
    this.ask = inTurn(async (request) => this.put(await request()));
    byId("forecast").addEventListener("click", () => this.forecast());
    byId("generate").addEventListener("click", () => this.start());
    byId("pause").addEventListener("click", () => this.pause());
    byId("sheet-limb").addEventListener("change", () => this.sheet());
  }

  // Called when the step is shown or its dataset has changed.
  async show() {
    clearTimeout(this.timer);
    const folder = this.actions.folder();
    if (!folder) return;
    const query = `?folder=${encodeURIComponent(folder)}`;
    try {
      await this.ask(() => getJson(`generation${query}`));
      this.shards(await getJson(`generation/shards${query}`));
    } catch (error) {
      this.refused(error);
    }
  }

  hide() {
    clearTimeout(this.timer);
    this.forecasting?.abort();
  }

  async start() {
    try {
      await this.ask(() => postJson("generation", { folder: this.actions.folder() }));
      this.actions.tell("");
      this.actions.started();
    } catch (error) {
      this.refused(error);
    }
  }

  async pause() {
    try {
      await this.ask(() => postJson("generation/pause", { folder: this.actions.folder() }));
    } catch (error) {
      this.refused(error);
    }
  }

  async poll() {
    try {
      await this.ask(() => getJson(`generation?folder=${encodeURIComponent(this.actions.folder())}`));
    } catch (error) {
      this.refused(error);
    }
  }

  put(state) {
    const { phase, pose_jobs, made, made_now, elapsed_s, limbs, error, commands } = state;
    const runs = phase === "running" || phase === "stopping";
    this.state = state;
    byId("phase").textContent = error ?? PHASES[phase];
    byId("phase").className = error ? "refused" : "value";
    byId("progress").max = Math.max(pose_jobs, 1);
    byId("progress").value = made;
    const left = phase === "running" && made_now > 0 ? `, about ${duration(elapsed_s / made_now * (pose_jobs - made))} left` : "";
    byId("progress-text").textContent = pose_jobs ? `${made} of ${pose_jobs} poses${left}` : "";
    byId("generate").disabled = runs || phase === "elsewhere" || phase === "complete";
    byId("generate").textContent = made > 0 || phase === "paused" ? "Resume" : "Start";
    byId("pause").disabled = phase !== "running";
    byId("command-list").replaceChildren(...commandRows([commands.forecast, commands.generate, commands.status]));
    this.choices(limbs);
    this.sheet();
    clearTimeout(this.timer);
    if (runs || phase === "elsewhere") this.timer = setTimeout(() => this.poll(), PROGRESS_MS);
  }

  choices(limbs) {
    const select = byId("sheet-limb");
    const values = limbs.map(({ patient, side }) => `${patient}/${side}`);
    if (values.join() === [...select.options].map((option) => option.value).join()) return;
    select.replaceChildren(...limbs.map(({ patient, side }) => new Option(`patient ${patient} ${side === "l" ? "left" : "right"}`, `${patient}/${side}`)));
  }

  // Updates the contact sheet with the poses made so far, at most every few seconds.
  async sheet() {
    const limb = byId("sheet-limb").value;
    const made = this.state?.made ?? 0;
    const folder = this.actions.folder();
    byId("sheet").hidden = !limb || made === 0;
    if (byId("sheet").hidden) return;
    const wanted = `${folder} ${limb} ${made}`;
    const sameLimb = this.sheetOf?.startsWith(`${folder} ${limb} `);
    if (this.drawing || wanted === this.sheetOf) return;
    if (sameLimb && this.state.phase === "running" && performance.now() - this.drawn < SHEET_MS) return;
    this.drawing = true;
    try {
      const png = await getBytes(`contact_sheet/${limb}?folder=${encodeURIComponent(folder)}`);
      const before = byId("sheet-image").src;
      byId("sheet-image").src = URL.createObjectURL(new Blob([png], { type: "image/png" }));
      if (before) URL.revokeObjectURL(before);
      byId("sheet-image").alt = `Contact sheet of patient ${limb.replace("/", " ")} with ${made} poses made`;
      this.sheetOf = wanted;
      this.drawn = performance.now();
    } catch (error) {
      // The first pose of this limb is not made yet, or a later request replaced this one.
      if (!(error instanceof Refused)) this.actions.fail(error);
    } finally {
      this.drawing = false;
    }
  }

  shards(shards) {
    byId("shards").hidden = shards.length === 0;
    const word = (shard) => (shard.complete ? "complete" : shard.running ? "being made" : shard.made > 0 ? "incomplete" : "not started");
    const rows = shards.map((shard) => [shard.shard, word(shard), `${shard.made} of ${shard.pose_jobs || "?"}`]);
    byId("shard-table").replaceChildren(table(["Shard", "State", "Poses"], rows));
  }

  async forecast() {
    this.forecasting?.abort();
    const asking = new AbortController();
    this.forecasting = asking;
    byId("forecast-text").textContent = "making one pose of every limb to measure …";
    try {
      const response = await post("forecast", { folder: this.actions.folder() }, asking.signal);
      const found = await response.json();
      byId("forecast-text").textContent = found.no_room ?? "";
      facts(byId("forecast-facts"), [
        ["Poses", `${found.units} of ${found.limbs} limb${found.limbs === 1 ? "" : "s"}`],
        ["Images", `${found.depth_images} depth images, ${found.radiographs} radiographs`],
        ["Processor time", `${fixed(found.cpu_s_per_unit)} s a pose, ${duration(3600 * found.cpu_hours)} in all`],
        ["Time", `${duration(3600 * found.wall_hours)} on ${found.threads} threads`],
        ["Disk", `${size(found.bytes)}${found.free_bytes ? `, ${size(found.free_bytes)} are free` : ""}`],
      ]);
      this.actions.started();
    } catch (error) {
      if (error.name === "AbortError") return;
      byId("forecast-text").textContent = "";
      this.refused(error);
    }
  }

  // Shows the refusal next to the controls.
  refused(error) {
    if (error instanceof Refused) {
      byId("phase").textContent = error.message;
      byId("phase").className = "refused";
    } else {
      this.actions.fail(error);
    }
  }
}
