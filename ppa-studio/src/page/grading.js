// Grading by readers: anonymous radiographs in random order, graded by key or button and saved at once. The step shows nothing
// else of the dataset and has no tab: readers open it by its address.

import { Refused, getBytes, postJson } from "/page/server.js";
import { button, commandRows } from "/page/elements.js";

const byId = (id) => document.getElementById(id);

const GRADES = [
  { grade: 1, key: "key 1, ideal", codes: ["Digit1", "Numpad1"] },
  { grade: 1.5, key: "key Q", codes: ["KeyQ"] },
  { grade: 2, key: "key 2", codes: ["Digit2", "Numpad2"] },
  { grade: 2.5, key: "key W", codes: ["KeyW"] },
  { grade: 3, key: "key 3, inadequate", codes: ["Digit3", "Numpad3"] },
];

// Number of pictures in memory: the previous, the current and the next one.
const KEPT = 3;

export class GradingPanel {
  constructor(actions) {
    this.actions = actions;
    this.pictures = new Map();
    this.commands = [];
    this.buttons = GRADES.map(({ grade, key }) => button(`${grade} (${key})`, () => this.give(grade)));
    byId("grading-grades").replaceChildren(...this.buttons);
    byId("grading-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.begin();
    });
    byId("grading-import").addEventListener("click", () => this.import());
    byId("grading-back").addEventListener("click", () => this.go(-1));
    byId("grading-on").addEventListener("click", () => this.go(1));
    // Closing waits for a grade that is being saved.
    byId("grading-end").addEventListener("click", () => { if (!this.saving) byId("grading").close(); });
    byId("grading").addEventListener("cancel", (event) => { if (this.saving) event.preventDefault(); });
    byId("grading").addEventListener("close", () => this.ended());
    document.addEventListener("keydown", (event) => { if (byId("grading").open) this.press(event); });
  }

  // Opens the step for a dataset.
  show(folder) {
    if (this.folder !== folder) {
      this.folder = folder;
      this.commands = [];
      byId("grading-dataset").textContent = folder;
      byId("grading-folder").value = `${folder}-readers`;
      for (const id of ["grading-text", "grading-refused"]) byId(id).textContent = "";
    }
    this.showCommands();
  }

  showCommands() {
    byId("command-list").replaceChildren(...commandRows(this.commands));
  }

  place() {
    return { folder: this.folder, readers: byId("grading-folder").value.trim() };
  }

  refused(error) {
    if (!(error instanceof Refused)) this.actions.fail(error);
    byId("grading-refused").textContent = error.message;
  }

  async begin() {
    const asked = { ...this.place(), reader: byId("grading-reader").value, every_deg: Number(byId("grading-every").value), seed: Number(byId("grading-seed").value) };
    byId("grading-refused").textContent = "";
    try {
      this.found = await postJson("grading", asked);
    } catch (error) {
      this.refused(error);
      return;
    }
    if (byId("grading").open) return;
    this.asked = asked;
    this.forget(0);
    this.commands = [this.found.commands.import, this.found.commands.agree];
    const first = this.found.pictures.findIndex((name) => !(name in this.found.grades));
    this.at = first < 0 ? 0 : first;
    byId("grading-failed").textContent = "";
    byId("grading").showModal();
    this.draw();
  }

  // Releases the oldest pictures.
  forget(kept) {
    for (const [name, url] of this.pictures) {
      if (this.pictures.size <= kept) return;
      this.pictures.delete(name);
      url.then(URL.revokeObjectURL, () => {});
    }
  }

  // Returns the URL of a picture in memory.
  picture(name) {
    if (!this.pictures.has(name)) {
      const { folder, readers } = this.asked;
      const bytes = getBytes(`grading/picture/${name}?${new URLSearchParams({ folder, readers })}`);
      const url = bytes.then((png) => URL.createObjectURL(new Blob([png], { type: "image/png" })));
      url.catch(() => this.pictures.delete(name));
      this.pictures.set(name, url);
      this.forget(KEPT);
    }
    return this.pictures.get(name);
  }

  // Sets the picture that can be graded: none until it is decoded.
  see(name) {
    this.seen = name;
    byId("grading-picture").setAttribute("aria-busy", String(!name));
  }

  async draw() {
    const { pictures, grades } = this.found;
    const name = pictures[this.at];
    const image = document.querySelector("#grading-picture img");
    image.removeAttribute("src");
    this.see(null);
    this.drawn = name;
    byId("grading-place").textContent = `Picture ${this.at + 1} of ${pictures.length}`;
    byId("grading-done").textContent = `${Object.keys(grades).length} of ${pictures.length} graded`;
    GRADES.forEach(({ grade }, n) => this.buttons[n].setAttribute("aria-pressed", String(grades[name] === grade)));
    try {
      const url = await this.picture(name);
      if (this.drawn !== name) return;
      image.src = url;
      await image.decode();
      if (this.drawn !== name) return;
      this.see(name);
      const next = pictures[this.at + 1];
      if (next) this.picture(next).catch(() => { /* said when it is shown */ });
    } catch (error) {
      if (this.drawn === name) byId("grading-failed").textContent = `Not shown: ${error.message}`;
    }
  }

  go(step) {
    if (this.saving) return;
    byId("grading-failed").textContent = "";
    this.at = Math.min(Math.max(this.at + step, 0), this.found.pictures.length - 1);
    this.draw();
  }

  // Grades the displayed picture only.
  async give(grade) {
    const image = this.seen;
    if (!image || this.saving) return;
    const { folder, readers, reader } = this.asked;
    this.saving = true;
    try {
      await postJson("grading/grade", { folder, readers, reader, image, grade });
      this.found.grades[image] = grade;
    } catch (error) {
      for (const id of ["grading-failed", "grading-refused"]) byId(id).textContent = `Not saved: ${error.message}`;
      return;
    } finally {
      this.saving = false;
    }
    this.go(1);
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
    const given = GRADES.find(({ codes }) => codes.includes(event.code));
    if (given) this.give(given.grade);
    else if (event.code === "ArrowLeft") this.go(-1);
    else if (event.code === "ArrowRight") this.go(1);
    else return;
    event.preventDefault();
  }

  ended() {
    this.drawn = null;
    this.see(null);
    document.querySelector("#grading-picture img").removeAttribute("src");
    this.forget(0);
    const { pictures, grades, file, key_found } = this.found;
    const count = Object.keys(grades).length;
    const saved = count > 0 ? `, saved in ${file}` : "";
    const key = key_found ? "; pictures and order are those of the existing key" : "";
    byId("grading-text").textContent = `${count} of ${pictures.length} pictures graded${saved}${key}`;
    this.showCommands();
  }

  async import() {
    const { readers } = this.place();
    if (!window.confirm(`Make labels from all grades in ${readers}? In labels.json they take the place of computed labels, which stay in labels.computed.json.`)) return;
    byId("grading-refused").textContent = "";
    try {
      const done = await postJson("grading/import", this.place());
      byId("grading-text").textContent = `${done.labelled} radiographs labelled by ${done.readers} reader${done.readers === 1 ? "" : "s"}; ${done.kept_computed} keep computed labels, ${done.without_label} have none`;
    } catch (error) {
      this.refused(error);
    }
  }
}
