// Parts removed from the scan, in colour next to the skin in step 2, and clicks on bodies in the 3D view.

import { loadRemoved } from "/page/surface.js";

const byId = (id) => document.getElementById(id);

export class Bodies {
  constructor(store, view, actions) {
    Object.assign(this, { store, view, actions, on: false });
    // Surface of the removed parts, requested once for each limb.
    this.removed = null;
    this.button = byId("body-pick");
    this.button.addEventListener("click", () => this.set(!this.on));
  }

  // Makes clicks pick bodies, or set the crosshair again.
  set(on) {
    this.on = on;
    this.button.setAttribute("aria-pressed", String(on));
    return this.show();
  }

  // Called for another limb, or another skin of it.
  changed() {
    this.removed = null;
    this.view.showRemoved(null);
    return this.set(false);
  }

  wanted() {
    return this.store.step === "skin" && (this.store.showRemoved || this.on);
  }

  // Shows or hides the removed parts.
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
      // The limb has changed meanwhile.
      if (asked !== this.removed) return;
    }
    this.view.showRemoved(this.wanted() ? surface : null);
    this.view.draw();
  }

  // Handles a click on a body, with a point inside it. Returns whether the click was for this panel.
  picked(point) {
    if (!this.on) return false;
    if (this.button.ariaBusy) return true;
    this.set(false);
    this.actions.change("body", { point });
    return true;
  }
}
