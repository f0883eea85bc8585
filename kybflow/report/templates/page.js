"use strict";
const figures = JSON.parse(document.getElementById("figures").textContent);
const overTime = figures.filter(f => f.over_time).map(f => f.name);
let linking = false;

function colours() {
  const style = getComputedStyle(document.documentElement);
  const word = name => style.getPropertyValue("--" + name).trim();
  return { ink: word("ink"), alarm: word("bad"), paper: word("paper"), rule: word("rule"),
           soft: word("soft"), panel: word("panel") };
}

function themed(value, words) {
  if (Array.isArray(value)) return value.map(v => themed(v, words));
  if (value === null || typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).map(([key, v]) =>
    [key, key === "color" && v in words ? words[v] : themed(v, words)]));
}

function axis(own, words) {
  return { gridcolor: words.rule, linecolor: words.rule, zerolinecolor: words.rule, ticks: "",
           automargin: true, ...own,
           title: { font: { color: words.soft, size: 13 }, standoff: 10, ...own.title } };
}

function draw() {
  const words = colours();
  for (const figure of figures) {
    const layout = themed(figure.layout, words);
    Plotly.react(figure.name, themed(figure.traces, words), {
      ...layout, xaxis: axis(layout.xaxis, words), yaxis: axis(layout.yaxis, words),
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", uirevision: "kept",
      font: { family: getComputedStyle(document.body).fontFamily, size: 13, color: words.ink },
      hoverlabel: { bgcolor: words.panel, bordercolor: words.rule, font: { color: words.ink } },
      legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom" },
      margin: { l: 64, r: 12, t: 12, b: 48 }, dragmode: "zoom",
    }, { responsive: true, displaylogo: false, displayModeBar: false });
  }
}

function link(name) {
  document.getElementById(name).on("plotly_relayout", change => {
    const zoomed = "xaxis.range[0]" in change, reset = "xaxis.autorange" in change;
    if (linking || !(zoomed || reset)) return;
    linking = true;
    const whole = figures.find(f => f.name === name).layout.xaxis.range;
    const range = zoomed ? [change["xaxis.range[0]"], change["xaxis.range[1]"]] : whole;
    Promise.all(overTime.map(other => Plotly.relayout(other, { "xaxis.range": [...range] })))
      .finally(() => { linking = false; });
  });
}

for (const folded of document.querySelectorAll("details"))
  folded.addEventListener("toggle", () => {
    if (folded.open) folded.querySelectorAll(".figure").forEach(figure => Plotly.Plots.resize(figure));
  });
draw();
overTime.forEach(link);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
matchMedia("print").addEventListener("change", draw);
