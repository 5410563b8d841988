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
const settings = { responsive: true, displayModeBar: false };  // the bar would lie over the legends
async function draw(place) {
  const chart = JSON.parse(document.getElementById(place.id + "-data").textContent);
  await Plotly.newPlot(place, chart.data, chart.layout, settings);
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
