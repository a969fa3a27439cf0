// SPDX-License-Identifier: MIT
// Signal to noise, latency and number of objects over time: the last two minutes, or the
// whole of a recording, where a click goes to that time.
import { svg, ticks } from "./axes.js";

const $ = (id) => document.getElementById(id);
const LEFT = 46;
const RIGHT = 10;
const TOP = 20; // for what is plotted, and its newest value
const HEIGHT = 62;
const GAP = 14;
const BELOW = 32;

// least: the top of the axis at least; step: values hold until the next one.
const PLOTS = [
    { name: "snr_db", title: "Signal to noise of the strongest", unit: "dB", least: 30 },
    { name: "latency_ms", title: "Latency of the list", unit: "ms", least: 100 },
    { name: "objects", title: "Objects", unit: "", least: 3, step: true },
];
const GAP_S = 1; // without a list, and the line is broken
const FEW = 60; // points that are drawn as such

// What is there, as {x, y}; and a line through it that is broken where nothing came.
function drawValues(parent, { name, step }, values, history, x, y) {
    const steps = Math.max(Math.round(GAP_S / history.step_s), 3);
    const points = values.map((v, i) => (v === null ? null : { i, x: x(i + 0.5), y: y(v) })).filter(Boolean);
    const path = points.map((p, k) => {
        const before = points[k - 1];
        const at = `${p.x.toFixed(1)} ${p.y.toFixed(1)}`;
        if (!before || p.i - before.i > steps) return `M${at}h.1`;
        return step ? `H${p.x.toFixed(1)}V${p.y.toFixed(1)}` : `L${at}`;
    });
    parent.append(svg("path", { class: "trend", "data-name": name, d: path.join("") }));
    if (points.length <= FEW)
        parent.append(...points.map((p) => svg("circle", { class: "trend-point", cx: p.x, cy: p.y, r: 2.2 })));
}

const newest = (values) => values.findLast((v) => v !== null);

function drawPlot(parent, plot, history, box, x) {
    const values = history[plot.name];
    const most = Math.max(plot.least, ...values.filter((v) => v !== null));
    const scale = ticks(0, most, 3);
    const top = Math.ceil(most / scale.step - 1e-9) * scale.step;
    const y = (v) => box.y + box.h - (Math.max(v, 0) / top) * box.h;
    for (let v = 0; v <= top + 1e-9; v += scale.step) {
        parent.append(svg("line", { class: "axis", x1: box.x, x2: box.x + box.w, y1: y(v), y2: y(v) }));
        parent.append(svg("text", { x: box.x - 7, y: y(v) + 4, "text-anchor": "end" }, String(Math.round(v))));
    }
    drawValues(parent, plot, values, history, x, y);
    parent.append(svg("text", { class: "trend-title", x: box.x, y: box.y - 7 }, plot.title));
    const last = newest(values);
    parent.append(svg("text", { class: "trend-now", "data-name": plot.name, x: box.x + box.w - 5, y: box.y - 7, "text-anchor": "end" },
        last === undefined ? "\u2013" : `${Math.round(last)} ${plot.unit}`.trim()));
}

function drawTimes(parent, from, to, box, x, isBag) {
    for (const s of ticks(from, to, Math.max(box.w / 90, 2)).at) {
        const at = x((s - from) / (to - from));
        parent.append(svg("line", { class: "frame", x1: at, x2: at, y1: box.y + box.h, y2: box.y + box.h + 4 }));
        parent.append(svg("text", { x: at, y: box.y + box.h + 15, "text-anchor": "middle" },
            String(Math.round(10 * (isBag ? s : -s)) / 10)));
    }
    parent.append(svg("text", { x: box.x + box.w / 2, y: box.y + box.h + 28, "text-anchor": "middle" },
        isBag ? "seconds since the start of the recording" : "seconds ago"));
}

// seek(s): of a recording.
export function createTrends(seek) {
    const trends = { history: null, isBag: false, at_s: null };

    trends.draw = () => {
        const { history, isBag } = trends;
        const room = $("trends").clientWidth - 30;
        $("trends-plots").hidden = !history;
        $("trends-about").textContent = !history ? "" : `The largest of each ${history.step_s < 1 ? `${Math.round(1000 * history.step_s)} ms` : `${history.step_s.toFixed(1)} s`}.` +
            (isBag ? " A click goes there." : "");
        if (!history || room < 130) return;
        const n = history.objects.length;
        const [from, to] = [history.from_s, history.from_s + n * history.step_s];
        const box = { x: LEFT, y: 0, w: room - LEFT - RIGHT, h: HEIGHT };
        const height = PLOTS.length * (TOP + HEIGHT + GAP) - GAP + BELOW;
        const drawing = svg("svg", { width: room, height, role: "img",
            "aria-label": PLOTS.map((p) => `${p.title}: ${newest(history[p.name]) ?? "none"} ${p.unit}`.trim()).join("; ") });
        const across = (part) => box.x + part * box.w;
        PLOTS.forEach((plot, i) => {
            box.y = TOP + i * (TOP + HEIGHT + GAP);
            drawPlot(drawing, plot, history, box, (k) => across(k / n));
        });
        drawTimes(drawing, from, to, box, across, isBag);
        if (isBag && trends.at_s !== null) {
            const at = across((trends.at_s - from) / (to - from));
            drawing.append(svg("line", { class: "trend-at", x1: at, x2: at, y1: TOP, y2: box.y + box.h }));
        }
        if (isBag) {
            drawing.classList.add("goes");
            drawing.onclick = (event) => {
                const part = (event.clientX - drawing.getBoundingClientRect().left - box.x) / box.w;
                if (part >= 0 && part <= 1) seek(from + part * (to - from));
            };
        }
        $("trends-plots").replaceChildren(drawing);
    };
    new ResizeObserver(() => trends.draw()).observe($("trends"));
    return trends;
}
