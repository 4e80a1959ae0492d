// Facts about the scan and its skin.

import { button, element, facts } from "/page/elements.js";
import { fixed, point } from "/page/geometry.js";

const byId = (id) => document.getElementById(id);

export function showScan(doc, actions) {
  facts(byId("scan-facts"), [
    ["Voxels", doc.grid.size.join(" × ")],
    ["Spacing", `${doc.grid.spacing_mm.map((x) => fixed(x, 3)).join(" × ")} mm`],
    ["Side", doc.side === "r" ? "right" : "left"],
  ]);
  const items = doc.findings.map((finding) => {
    const item = element("li", `${finding.severity} [${finding.code}] ${finding.text} `, { class: finding.severity });
    if (finding.place_mm) item.append(button("Show", () => actions.place(finding.place_mm), `Show ${finding.code}`));
    if (finding.severity === "severe") {
      const known = doc.acknowledged.includes(finding.code);
      const codes = ({ acknowledged }) => (known ? acknowledged.filter((code) => code !== finding.code) : [...acknowledged, finding.code]);
      item.append(button(known ? "Acknowledged" : "Acknowledge", () => actions.change("acknowledged", codes), `Acknowledge ${finding.code}`));
    }
    return item;
  });
  byId("findings").replaceChildren(...(items.length ? items : [element("li", "none")]));
}

export function showSkin(doc, actions) {
  byId("iso").max = doc.core_hu;
  byId("iso").value = doc.iso_hu;
  byId("iso-value").textContent = fixed(doc.iso_hu, 0);
  byId("side").value = doc.side;
  const { report } = doc;
  byId("bodies").replaceChildren(...report.bodies.filter((body, rank) => rank < 8 || body.kept?.length).map((body) => {
    const points = body.kept ?? [];
    const state = body.chosen ? "taken: " : points.length ? "kept: " : "removed: ";
    const item = element("li", `${state}${fixed(body.core_mm3 / 1000, 0)} ml around ${point(body.centre_mm, 0)} mm `);
    const where = `the body around ${point(body.centre_mm, 0)} mm`;
    item.append(button("Show", () => actions.place(body.inside_mm), `Show ${where}`));
    if (body.chosen) return item;
    item.append(button("Take", () => actions.change("surface", { inside: body.inside_mm }), `Take ${where}`));
    const change = points.length ? "Remove" : "Keep";
    item.append(button(change, () => actions.change("body", { point: points[0] ?? body.inside_mm }), `${change} ${where}`));
    return item;
  }));
  byId("limb-find").disabled = !doc.inside;
  facts(byId("skin-facts"), [
    ["Limb", `${fixed(report.limb_mm3 / 1000, 0)} ml`],
    ["Couch removed", `${report.couch_voxels} voxels`],
    ["Other removed", `${report.other_voxels} voxels`],
    ["Points of skin", String(report.points)],
    ["Cut by faces", String(report.cut_faces.length)],
  ]);
}
