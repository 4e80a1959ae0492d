// Absorbed dose of the displayed exposure.

import { post } from "/page/server.js";
import { table } from "/page/elements.js";
import { fixed } from "/page/geometry.js";

const byId = (id) => document.getElementById(id);

export class DoseTable {
  constructor(actions) {
    this.actions = actions;
    byId("dose-begin").addEventListener("click", () => this.begin());
  }

  // The exposure has changed or is no longer shown.
  clear() {
    this.following?.abort();
    this.following = null;
    byId("dose-begin").disabled = true;
    byId("dose-text").textContent = "";
    byId("dose-table").replaceChildren();
  }

  // Enables the dose when the radiograph is complete, with its tube load, if any.
  offer(mas) {
    this.mas = mas;
    byId("dose-begin").disabled = false;
  }

  async begin() {
    if (this.following) return;
    const following = new AbortController();
    this.following = following;
    byId("dose-text").textContent = "following photons …";
    byId("dose-table").replaceChildren();
    byId("dose-text").scrollIntoView({ block: "nearest" });
    try {
      const dose = await (await post("dose", this.actions.whatIf(), following.signal)).json();
      if (!following.signal.aborted) this.show(dose);
    } catch (error) {
      if (following.signal.aborted) return;
      byId("dose-text").textContent = "";
      this.actions.failed(error);
    } finally {
      if (this.following === following) this.following = null;
    }
  }

  show({ histories, histories_per_mas, matter }) {
    // If the fluence of the spectrum is unknown, only the dose per photon is known.
    const [unit, photons] = histories_per_mas ? ["µGy per mAs", 1e6 * histories_per_mas] : ["aGy per photon", 1e18];
    const heads = ["Matter", "g", unit];
    const load = histories_per_mas && this.mas;
    if (load) heads.push(`µGy with ${fixed(load, 2)} mAs`);
    const rows = matter.map(({ name, mass_g, gy_per_history, gy_per_history_se }) => {
      const value = (factor) => `${significant(factor * gy_per_history)} ± ${significant(factor * gy_per_history_se)}`;
      const cells = [name.replaceAll("_", " "), fixed(mass_g, 0), value(photons)];
      if (load) cells.push(value(photons * load));
      return cells;
    });
    byId("dose-text").textContent = `Absorbed dose, mean over the voxels that the radiograph is computed from, of ${histories / 1e6} million analog histories, with standard errors`;
    byId("dose-table").replaceChildren(table(heads, rows));
    byId("dose-table").scrollIntoView({ block: "nearest" });
  }
}

const significant = (value) => Number(value.toPrecision(3)).toString();
