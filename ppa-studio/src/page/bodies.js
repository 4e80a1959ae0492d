// A click on a body in the view in three dimensions, in step 2: keeps it as a part of the limb, or removes it.

import { surfaceAt } from "/page/surface.js";

const byId = (id) => document.getElementById(id);

export class BodyPicker {
  constructor(store, view, actions) {
    Object.assign(this, { store, view, actions, on: false });
    this.button = byId("body-pick");
    this.button.addEventListener("click", () => this.set(!this.on));
  }

  // Shows all that is in the scan to be clicked on, or the skin again.
  async set(on) {
    if (on === this.on) return;
    this.on = on;
    this.button.setAttribute("aria-pressed", String(on));
    if (!on) return this.actions.surface();
    this.button.ariaBusy = "true";
    try {
      const surface = await surfaceAt(this.store.doc.iso_hu);
      if (this.on) {
        this.view.show(surface);
        this.view.draw();
      }
    } catch (error) {
      // A newer surface was asked for.
      if (error.status !== 409) this.actions.fail(error);
    } finally {
      this.button.ariaBusy = null;
    }
  }

  // The view shows the skin again: the limb has changed.
  end() {
    this.on = false;
    this.button.setAttribute("aria-pressed", "false");
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
