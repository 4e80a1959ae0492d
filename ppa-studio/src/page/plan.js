// The form of the plan: a field for each key declared by the types of the plan.

import { Refused, getJson, inTurn, newest, postJson } from "/page/server.js";
import { button, element, table } from "/page/elements.js";

const byId = (id) => document.getElementById(id);

// Tables that are open at first: most plans change their keys.
const OPEN = ["rotation", "shapes", "soft_tissue", "positioning"];

const HINTS = {
  "depth.cameras": "The cameras in use. A value that is changed here writes both cameras into the plan, in place of the name of a rig.",
};

const MOST_PATIENT = 2 ** 32 - 1;

// Each returns an element, a function that shows a field's value, and the note below the field's meaning, if any.
const INPUTS = { name: nameInput, names: namesInput, file: fileInput, rows: rowsInput };

// Defaults if no file is chosen.
const WITHOUT_FILE = { "depth.rig": "built-in Azure Kinect pair", "xray.calibration_file": "built-in table" };

const WRITTEN = " written";

// Placeholder of a field without a value.
const withoutValue = ({ default: standard, example }) => standard ?? (example ? `off; such as ${example}` : "off");

function typed(input, set) {
  input.addEventListener("change", () => set(input.value.trim() || null));
  return [input, (field) => {
    input.value = field.value ?? "";
    input.placeholder = withoutValue(field);
  }];
}

function textInput(field, id, set) {
  const input = element("input", "", { id, type: "text", autocomplete: "off", spellcheck: "false" });
  if (field.kind === "number") input.inputMode = "decimal";
  return typed(input, set);
}

function rowsInput(field, id, set) {
  return typed(element("textarea", "", { id, rows: 4, wrap: "off", autocomplete: "off", spellcheck: "false" }), set);
}

function nameInput(field, id, set) {
  const select = element("select", "", { id });
  const standard = new Option("", "");
  select.append(standard, ...field.names.map(([name, meaning]) => new Option(`${name}: ${meaning}`, name)));
  select.addEventListener("change", () => set(select.value || null));
  return [select, (field) => {
    // Cameras have no default while the rig of the plan cannot be read.
    standard.textContent = field.default === null ? "no default" : `default: ${field.default}`;
    standard.hidden = field.required;
    select.value = field.value ?? "";
  }];
}

// Choice of a file next to the plan, the default, or the table in the plan; lists unreadable files. The files may change.
function fileInput(field, id, set) {
  const select = element("select", "", { id, class: "file" });
  const refused = element("ul", "", { id: `${id}:unreadable`, class: "unreadable" });
  select.addEventListener("change", () => {
    if (select.value !== WRITTEN) set(select.value || null);
  });
  return [select, ({ key, names, value, instead, unreadable }) => {
    const options = [new Option(`default: ${WITHOUT_FILE[key]}`, "")];
    if (instead) options.push(new Option(`written in the plan as ${instead}`, WRITTEN));
    options.push(...names.map(([name, meaning]) => new Option(`${name}: ${meaning}`, name)));
    if (value && !names.some(([name]) => name === value)) options.push(new Option(value));
    select.replaceChildren(...options);
    select.value = value ?? (instead ? WRITTEN : "");
    refused.replaceChildren(...unreadable.map(([name, reason]) => element("li", `${name} cannot be read: ${reason}`)));
  }, refused];
}

function namesInput(field, id, set) {
  const group = element("div", "", { role: "group", "aria-labelledby": `${id}:name`, class: "names" });
  const boxes = field.names.map(([name, meaning]) => {
    const label = element("label", "", { title: meaning });
    const box = element("input", "", { type: "checkbox", id: `${id}:${name}`, value: name });
    box.addEventListener("change", () => set(boxes.filter((one) => one.checked).map((one) => one.value).join(" ")));
    label.append(box, ` ${name}`);
    group.append(label);
    return box;
  });
  return [group, ({ value, default: standard }) => {
    const chosen = (value ?? standard ?? "").split(" ");
    for (const box of boxes) box.checked = chosen.includes(box.value);
  }];
}

// Describes the range of numbers that a plan accepts.
function limitsText(limits) {
  if (!limits) return "";
  const end = (limit, included, excluded) => limit && `${limit.included ? included : excluded} ${Number(limit.value.toPrecision(6))}`;
  const ends = [end(limits.low, "at least", "above"), end(limits.high, "at most", "below")].filter(Boolean);
  return ends.length ? ` Accepted: ${ends.join(", ")}.` : "";
}

function materialRow({ segment, from_hu, materials, density }) {
  const knots = density.map(([hu, g_cm3]) => `${g_cm3} at ${hu}`);
  return [segment, from_hu === null ? "" : String(from_hu), materials.join(" to "), knots.join(", ")];
}

export class PlanPanel {
  constructor(actions) {
    this.actions = actions;
    this.plan = null;
    this.updates = [];
    this.ask = inTurn(async (request) => this.show(await request()));
    this.materials = element("div", "", { id: "plan-materials" });
    this.limits = newest((of) => this.showLimits(of));
    byId("plan-save").addEventListener("click", () => this.save());
    for (const step of ["undo", "redo"]) byId(`plan-${step}`).addEventListener("click", () => this.change(`plan/${step}`, {}));
    byId("plan-folder").addEventListener("change", () => actions.folder());
    byId("plan-add").addEventListener("click", () => this.change("plan/limbs", { add: { case: byId("plan-cases").value } }));
  }

  async load() {
    try {
      await this.ask(() => getJson("plan/form"));
    } catch (error) {
      this.actions.fail(error);
    }
  }

  folder() {
    return byId("plan-folder").value.trim();
  }

  async change(path, body) {
    // Limbs are identified by their indices, which may change.
    byId("plan-limbs").inert = true;
    try {
      await this.ask(() => postJson(path, body));
      this.actions.tell("");
      this.actions.changed();
    } catch (error) {
      // Restores the values of the plan.
      if (this.plan) this.show(this.plan);
      this.actions.fail(error);
    } finally {
      byId("plan-limbs").inert = false;
    }
  }

  show(plan) {
    this.plan = plan;
    byId("plan-file").textContent = plan.has_edits ? `changes saved in ${plan.current}`
      : plan.is_saved ? `${plan.original}, no changes` : `${plan.original} is not saved yet`;
    byId("plan-save").textContent = plan.is_saved ? "Save over the plan" : "Save the plan";
    byId("plan-save").disabled = plan.is_saved && !plan.has_edits;
    byId("plan-undo").disabled = !plan.can_undo;
    byId("plan-redo").disabled = !plan.can_redo;
    if (!byId("plan-folder").value) byId("plan-folder").value = plan.dataset;
    byId("plan-limbs").replaceChildren(...plan.limbs.map((limb, number) => this.limb(limb, number)));
    byId("plan-cases").replaceChildren(...plan.other_cases.map((name) => new Option(name)));
    byId("plan-add").disabled = plan.other_cases.length === 0;
    if (this.updates.length === 0) byId("plan-form").append(...this.groups(plan.fields));
    for (const update of this.updates) update(new Map(plan.fields.map((field) => [field.key, field])));
    this.materials.replaceChildren(table(["Segment", "From HU", "Material", "g/cm³ at HU"], plan.materials.map(materialRow)));
  }

  limb(limb, number) {
    const item = element("li", `${limb.case}, patient `);
    const patient = element("input", "", { type: "number", min: 0, step: 1, value: limb.patient, "aria-label": `Patient of ${limb.case}` });
    const limbs = (change) => this.change("plan/limbs", change);
    patient.addEventListener("change", () => {
      const typed = patient.valueAsNumber;
      if (Number.isInteger(typed) && typed >= 0 && typed <= MOST_PATIENT) return limbs({ patient: { number, patient: typed } });
      this.show(this.plan);
      this.actions.fail(new Error(`A patient is a whole number from 0 to ${MOST_PATIENT}`));
    });
    item.append(patient, " ");
    if (limb.has_edits) {
      const text = limb.uses_edits ? "Use the case without changes" : "Use the changed case";
      item.append(button(text, () => limbs({ case: { number, edits: !limb.uses_edits } }), `${text} for ${limb.case}`));
    }
    if (this.plan.limbs.length > 1) item.append(button("Remove", () => limbs({ remove: { number } }), `Remove ${limb.case}`));
    return item;
  }

  // Makes a collapsible group for each table. The groups are made once; later changes update their fields.
  groups(fields) {
    const top = element("div");
    const groups = new Map([["", top]]);
    for (const field of fields) {
      const at = field.key.lastIndexOf(".");
      const parent = groups.get(at < 0 ? "" : field.key.slice(0, at)) ?? top;
      const made = field.kind === "heading" ? this.group(field) : this.row(field);
      if (field.kind === "heading") groups.set(field.key, made);
      parent.append(made);
      if (field.key === "xray.calibration_file") parent.append(this.materials);
    }
    return [top];
  }

  group({ key, meaning }) {
    const group = element("details");
    group.open = OPEN.includes(key);
    const summary = element("summary");
    group.append(summary, element("p", HINTS[key] ?? meaning, { class: "hint" }));
    this.updates.push((fields) => {
      const given = [...fields.values()].filter((field) => field.value !== null && field.kind !== "heading" && field.key.startsWith(`${key}.`));
      summary.textContent = given.length ? `${key}, ${given.length} given` : key;
    });
    return group;
  }

  // Limits depend on the other settings, so they are requested when a field gets the focus.
  async showLimits({ key, hint }) {
    try {
      hint.textContent = limitsText(await postJson("plan/limits", { key }));
    } catch (error) {
      this.actions.fail(error);
    }
  }

  row(field) {
    const id = `plan:${field.key}`;
    const error = element("p", "", { class: "refused", id: `${id}:refused`, role: "alert" });
    const set = async (value) => {
      error.textContent = "";
      try {
        await this.ask(() => postJson("plan/key", { key: field.key, value }));
        this.actions.tell("");
        this.actions.changed();
      } catch (refusal) {
        if (refusal instanceof Refused) error.textContent = refusal.message;
        else this.actions.fail(refusal);
      }
    };
    const [input, put, more = ""] = (INPUTS[field.kind] ?? textInput)(field, id, set);
    input.setAttribute("aria-describedby", `${id}:hint ${id}:refused`);
    const name = field.key.slice(field.key.lastIndexOf(".") + 1);
    const label = field.kind === "names" ? element("span", name, { id: `${id}:name` }) : element("label", name, { for: id });
    const standard = button("Default", () => set(null), `Default of ${field.key}`);
    const row = element("div", "", { class: "field" });
    const meaning = element("p", field.meaning, { class: "hint", id: `${id}:hint` });
    if (field.kind === "number") {
      const hint = element("span");
      meaning.append(hint);
      input.addEventListener("focus", () => this.limits({ key: field.key, hint }));
    }
    row.append(label, input, standard, meaning, more, error);
    this.updates.push((fields) => {
      const now = fields.get(field.key);
      row.classList.toggle("given", now.value !== null);
      standard.hidden = now.required || (now.value === null && !now.instead);
      put(now);
    });
    return row;
  }

  save() {
    const { is_saved, original } = this.plan;
    if (!is_saved || window.confirm(`Replace ${original} with the changed plan?`)) this.change("plan/save");
  }
}
