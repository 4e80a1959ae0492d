// The skin in a body shape of the dataset, in step 2.

import { fixed } from "/page/geometry.js";
import { loadShape, loadSurface } from "/page/surface.js";

const byId = (id) => document.getElementById(id);

export class ShapePanel {
  constructor(store, actions) {
    this.store = store;
    // The last request: a shape, or "" for the skin of the scan.
    this.asked = "";
    this.loads = 0;
    byId("skin-shape").addEventListener("change", () => actions.surface());
  }

  // Other steps show the skin of the scan, where landmarks are placed.
  wanted() {
    return this.store.step === "skin" ? byId("skin-shape").value : "";
  }

  isCurrent() {
    return this.asked === this.wanted();
  }

  // Loads the surface to show; null if another one was requested meanwhile.
  async load() {
    const wanted = this.wanted();
    const number = ++this.loads;
    this.asked = wanted;
    let surface;
    try {
      surface = wanted ? await loadShape(wanted) : await loadSurface();
    } catch (error) {
      if (number === this.loads) this.asked = null;
      throw error;
    }
    if (number !== this.loads) return null;
    byId("shape-legend").textContent = wanted ? legend(surface.outwards) : "";
    return surface;
  }
}

function legend(outwards) {
  let [least, most] = [Infinity, -Infinity];
  for (const mm of outwards) {
    least = Math.min(least, mm);
    most = Math.max(most, mm);
  }
  return `Moved by ${fixed(least)} to ${fixed(most)} mm: orange outwards, blue inwards`;
}
