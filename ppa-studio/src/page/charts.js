// SVG charts: lines, spreads, and points that can be clicked.

const SPACE = "http://www.w3.org/2000/svg";
const [WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM] = [440, 250, 52, 12, 12, 36];

// Colours for colour-blind readers (Okabe and Ito), light enough for the dark page.
const COLOURS = ["#56b4e9", "#e69f00", "#2fc39b", "#f0e442", "#cc79a7", "#ff8a4c", "#9fb4ff", "#e8e8e8"];

// When the colours repeat, dashes and point shapes distinguish the series.
const MARKS = [
  { shape: "circle", dashes: "none" },
  { shape: "square", dashes: "7 3" },
  { shape: "triangle", dashes: "2 3" },
  { shape: "diamond", dashes: "10 3 2 3" },
];

// Maximum number of series with different styles.
export const MOST_SERIES = COLOURS.length * MARKS.length;

// Style of a series by its number: { colour, shape, dashes }.
export function styleOf(number) {
  return { colour: COLOURS[number % COLOURS.length], ...MARKS[Math.floor(number / COLOURS.length) % MARKS.length] };
}

// Maximum number of points in a chart; with more, only lines are drawn.
const MOST_POINTS = 3000;

function node(name, attributes, content = "") {
  const made = document.createElementNS(SPACE, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.textContent = content;
  return made;
}

function ticks([low, high], most) {
  const step = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(step));
  const nice = [1, 2, 5, 10].map((n) => n * power).find((n) => n >= step);
  const found = [];
  for (let at = Math.ceil(low / nice) * nice; at <= high + 1e-9; at += nice) found.push(Number(at.toPrecision(6)));
  return found;
}

const text = (value) => (Math.abs(value) >= 1e5 ? value.toExponential() : String(value));

function range(values) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const margin = 0.06 * (high - low) || 1;
  return [low - margin, high + margin];
}

export const ROTATION = "medial rotation, degrees";

// `axes`: { x, y }, their labels; `series`: { style, points: [{ x, y, spread, ringed, of }] }; a click on a point calls `picked`,
// if given, with `of`.
export function chart(title, axes, series, yRange, picked) {
  const all = series.flatMap((one) => one.points);
  const svg = node("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": `${title}, ${axes.y}, against ${axes.x}` });
  if (all.length === 0) return svg;
  const [xs, ys] = [range(all.map((p) => p.x)), yRange ?? range(all.map((p) => p.y))];
  const x = (value) => LEFT + (value - xs[0]) / (xs[1] - xs[0]) * (WIDTH - LEFT - RIGHT);
  const y = (value) => HEIGHT - BOTTOM - (value - ys[0]) / (ys[1] - ys[0]) * (HEIGHT - TOP - BOTTOM);
  for (const at of ticks(xs, 8)) {
    svg.append(node("path", { d: `M${x(at)} ${TOP}V${HEIGHT - BOTTOM}`, class: "grid" }), node("text", { x: x(at), y: HEIGHT - BOTTOM + 14, "text-anchor": "middle" }, text(at)));
  }
  for (const at of ticks(ys, 5)) {
    svg.append(node("path", { d: `M${LEFT} ${y(at)}H${WIDTH - RIGHT}`, class: "grid" }), node("text", { x: LEFT - 5, y: y(at) + 4, "text-anchor": "end" }, text(at)));
  }
  svg.append(node("text", { x: (LEFT + WIDTH) / 2, y: HEIGHT - 5, "text-anchor": "middle" }, axes.x));
  svg.append(node("text", { x: 12, y: TOP + (HEIGHT - TOP - BOTTOM) / 2, "text-anchor": "middle", transform: `rotate(-90 12 ${TOP + (HEIGHT - TOP - BOTTOM) / 2})` }, axes.y));
  for (const { style, points } of series) {
    const { colour, dashes } = style;
    if (points.some((p) => p.spread)) {
      const within = (value) => y(Math.max(ys[0], Math.min(ys[1], value)));
      const there = points.map((p) => `${x(p.x)},${within(p.y + p.spread)}`);
      const back = points.map((p) => `${x(p.x)},${within(p.y - p.spread)}`).reverse();
      svg.append(node("polygon", { points: [...there, ...back].join(" "), fill: colour, "fill-opacity": 0.25 }));
    }
    svg.append(node("polyline", { points: points.map((p) => `${x(p.x)},${y(p.y)}`).join(" "), fill: "none", stroke: colour, "stroke-width": 1.3, "stroke-dasharray": dashes }));
    for (const p of points) {
      if (p.ringed) svg.append(node("circle", { cx: x(p.x), cy: y(p.y), r: 8, fill: "none", stroke: "#ff8f8f", "stroke-width": 2 }));
      if (all.length > MOST_POINTS && !p.ringed) continue;
      const dot = drawn(style, x(p.x), y(p.y), 3);
      if (picked) {
        dot.setAttribute("class", "pose");
        dot.addEventListener("click", () => picked(p.of));
      }
      svg.append(dot);
    }
  }
  return svg;
}

// Draws a point of a series, about as large as a circle of radius `r`.
function drawn({ colour, shape }, x, y, r) {
  if (shape === "circle") return node("circle", { cx: x, cy: y, r, fill: colour });
  const corners = { square: [[-1, -1], [1, -1], [1, 1], [-1, 1]], triangle: [[0, -1.3], [1.2, 0.9], [-1.2, 0.9]], diamond: [[0, -1.4], [1.4, 0], [0, 1.4], [-1.4, 0]] }[shape];
  return node("polygon", { points: corners.map(([dx, dy]) => `${x + r * dx},${y + r * dy}`).join(" "), fill: colour });
}

// Legend mark of a series: a piece of its line with a point.
export function mark(style) {
  const svg = node("svg", { viewBox: "0 0 28 10", "aria-hidden": "true", class: "mark" });
  svg.append(node("path", { d: "M0 5H28", fill: "none", stroke: style.colour, "stroke-width": 1.6, "stroke-dasharray": style.dashes }), drawn(style, 14, 5, 3.4));
  return svg;
}
