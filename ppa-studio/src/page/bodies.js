// What was removed from the scan, in colour beside the skin in step 2, and clicks on bodies in three dimensions.

import { loadRemoved } from "/page/surface.js";

const byId = (id) => document.getElementById(id);

export class Bodies {
  constructor(store, view, actions) {
    Object.assign(this, { store, view, actions, on: false });
    // What was removed, asked for once for each limb.
    this.removed = null;
    this.button = byId("body-pick");
    this.button.addEventListener("click", () => this.set(!this.on));
  }

  // Clicks are on bodies, or set the crosshair again.
  set(on) {
    this.on = on;
    this.button.setAttribute("aria-pressed", String(on));
    return this.show();
  }

  // Another limb, or another skin of it.
  changed() {
    this.removed = null;
    this.view.showRemoved(null);
    return this.set(false);
  }

  wanted() {
    return this.store.step === "skin" && (this.store.showRemoved || this.on);
  }

  // Shows what was removed, or hides it.
  async show() {
    if (!this.store.doc) return;
    let surface = null;
    if (this.wanted()) {
      this.removed ??= loadRemoved();
      const asked = this.removed;
      this.button.ariaBusy = "true";
      try {
        surface = await asked;
      } catch (error) {
        if (asked === this.removed) this.removed = null;
        return this.actions.fail(error);
      } finally {
        this.button.ariaBusy = null;
      }
      // Of another limb by now.
      if (asked !== this.removed) return;
    }
    this.view.showRemoved(this.wanted() ? surface : null);
    this.view.draw();
  }

  // Whether a click was one on a body; the point lies inside it.
  picked(point) {
    if (!this.on) return false;
    if (this.button.ariaBusy) return true;
    this.set(false);
    this.actions.change("body", { point });
    return true;
  }
}
