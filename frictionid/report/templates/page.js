"use strict";
document.documentElement.classList.add("scripts");

// Tables: a click on a heading sorts by its column, a second one the other way round.
function weight(cell) {
  const text = cell.textContent.trim().replace("−", "-");
  if (text.startsWith("∞")) return Infinity;
  const number = parseFloat(text.replace(/^[<>]/, ""));
  return Number.isNaN(number) ? text : number;
}
function order(a, b) {
  const words = [typeof a, typeof b].map((type) => type === "string");
  if (words[0] !== words[1]) return words[0] ? 1 : -1;
  return words[0] ? a.localeCompare(b) : a - b || 0;
}
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => head.querySelector("button").addEventListener("click", () => {
    const down = head.getAttribute("aria-sort") === "ascending";
    heads.forEach((other) => other.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const rows = [...table.tBodies[0].rows];
    rows.sort((a, b) => (down ? -1 : 1) * order(weight(a.cells[column]), weight(b.cells[column])));
    table.tBodies[0].append(...rows);
  }));
}

// Charts: the library is unpacked once, each chart is drawn when it comes near the screen.
async function library() {
  const packed = atob(document.getElementById("plotly").textContent);
  const bytes = Uint8Array.from(packed, (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const script = document.createElement("script");
  script.textContent = await new Response(stream).text();
  document.head.append(script);
}
// What all charts look like: fingers scroll the page, the bar would zoom.
const plainAxis = { gridcolor: "#E6E6E6", automargin: true, zerolinecolor: "#BBBBBB", linecolor: "#888888" };
const look = {
  font: { family: "system-ui, sans-serif", size: 12, color: "#222222" },
  margin: { l: 52, r: 10, t: 8, b: 40 },
  paper_bgcolor: "rgba(0,0,0,0)",
  plot_bgcolor: "rgba(0,0,0,0)",
  dragmode: false,
  hovermode: "x unified",
  hoverlabel: { namelength: 28 },
  legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 },
};
function layout(chart) {
  const whole = { ...look, ...chart.layout, ...(chart.frames.length ? controls(chart.frames) : {}) };
  for (const name of Object.keys(chart.layout).filter((key) => chart.layout[key].title)) {
    const axis = chart.layout[name];
    whole[name] = { ...plainAxis, ...axis, title: { standoff: 8, ...axis.title } };
  }
  return whole;
}
// Play and pause below the labels of the axis, and below them a slider of the time of the drawing.
function controls(frames) {
  const times = frames.map((frame) => Number(frame.name));
  const duration = 1e3 * (times.at(-1) - times[0]) / Math.max(times.length - 1, 1);
  const now = { frame: { duration: 0, redraw: false }, mode: "immediate" };
  const play = { frame: { duration, redraw: false }, transition: { duration: 0 }, fromcurrent: true, mode: "immediate" };
  return {
    margin: { l: 52, r: 10, t: 34, b: 130, autoexpand: false },
    updatemenus: [{
      type: "buttons", direction: "left", x: 0, y: -0.17, xanchor: "left", yanchor: "top",
      showactive: false, pad: { t: 0, r: 6 },
      buttons: [
        { label: "▶ play", method: "animate", args: [null, play] },
        { label: "❚❚ pause", method: "animate", args: [[null], now] },
      ],
    }],
    sliders: [{
      steps: frames.map((frame, i) => ({ label: times[i].toFixed(2), method: "animate", args: [[frame.name], now] })),
      x: 0, len: 1.0, y: -0.28, yanchor: "top", pad: { t: 0, b: 0 }, ticklen: 0, minorticklen: 0,
      font: { color: "rgba(0,0,0,0)" },
      currentvalue: { prefix: "time ", suffix: " s", font: { size: 12, color: "#222" } },
    }],
  };
}
const settings = { responsive: true, displayModeBar: false };  // the bar would lie over the legends
async function draw(place) {
  const chart = JSON.parse(document.getElementById(place.id + "-data").textContent);
  await Plotly.newPlot(place, chart.data, layout(chart), settings);
  if (chart.frames.length) await Plotly.addFrames(place, chart.frames);
  place.dataset.drawn = "yes";
}
const charts = document.querySelectorAll(".chart");
if (charts.length) {
  library().then(() => {
    const watch = new IntersectionObserver((seen) => {
      for (const one of seen.filter((entry) => entry.isIntersecting)) {
        watch.unobserve(one.target);
        draw(one.target);
      }
    }, { rootMargin: "400px" });
    charts.forEach((place) => watch.observe(place));
  }).catch(() => document.documentElement.classList.remove("scripts"));
}
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((one) => { one.open = true; }));
