// SPDX-License-Identifier: MIT
// Places for labels in a drawing where they hide neither each other nor what they name.
import { svg } from "./axes.js";

const pen = document.createElement("canvas").getContext("2d");
const LINE = 14; // px

const overlap = (a, b) => Math.max(Math.min(a.x + a.w, b.x + b.w) - Math.max(a.x, b.x), 0) *
    Math.max(Math.min(a.y + a.h, b.y + b.h) - Math.max(a.y, b.y), 0);

// Where a box of w x h may stand beside a point, or first of all on it when it is not to
// be away from it; the best place first.
function* places(x, y, w, h, away) {
    if (!away) yield { x: x - w / 2, y: y - h / 2, w, h };
    for (const far of [away || 8, 2.2 * (away || 8), 4 * (away || 8)])
        for (const [u, v] of [[1, -1], [-1, -1], [1, 1], [-1, 1], [0, -1], [0, 1], [1, 0], [-1, 0]])
            yield { x: x + u * far - (u < 0 ? w : u ? 0 : w / 2),
                y: y + v * far * 0.7 - (v < 0 ? h : v ? 0 : h / 2), w, h };
}

// box: {x, y, w, h}, where labels have to stay.
export function createLabels(box) {
    const taken = [];
    const drawn = [];
    const labels = { drawn };

    labels.keepFree = (x, y, w, h) => taken.push({ x, y, w, h });
    // Of a line through a point, x + k u, y + k v, what is in the box.
    labels.keepLineFree = (x, y, u, v) => {
        for (let k = -2000; k <= 2000; k += 8) {
            const [px, py] = [x + k * u, y + k * v];
            if (px >= box.x && px <= box.x + box.w && py >= box.y && py <= box.y + box.h)
                labels.keepFree(px - 3, py - 3, 6, 6);
        }
    };
    // lines: of text; must: it is drawn even where there is no room.
    labels.add = (kind, x, y, lines, { away = 10, must = false, bold = false } = {}) => {
        pen.font = `${bold ? "bold 12px" : "11px"} system-ui, "Segoe UI", "DejaVu Sans", sans-serif`;
        const w = Math.max(...lines.map((t) => pen.measureText(t).width)) + 6;
        const h = LINE * lines.length + 2;
        let best = null;
        for (const p of places(x, y, w, h, away)) {
            p.x = Math.min(Math.max(p.x, box.x + 1), box.x + box.w - w - 1);
            p.y = Math.min(Math.max(p.y, box.y + 1), box.y + box.h - h - 1);
            p.bad = taken.reduce((sum, t) => sum + overlap(p, t), 0);
            if (!best || p.bad < best.bad) best = p;
            if (!p.bad) break;
        }
        if (best.bad > 0 && !must) return;
        taken.push(best);
        drawn.push(svg("text", { class: `plan-label ${kind}` }, ...lines.map((text, i) =>
            svg("tspan", { x: best.x + 3, y: best.y + LINE * (i + 1) - 3 }, text))));
    };
    return labels;
}
