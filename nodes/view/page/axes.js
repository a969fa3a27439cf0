// SPDX-License-Identifier: MIT
// Axes in metres, drawn with SVG.
export function svg(name, attributes = {}, ...children) {
    const e = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) e.setAttribute(key, value);
    e.append(...children);
    return e;
}

// Round numbers from min to max, about `most` of them at most.
export function ticks(min, max, most) {
    const raw = (max - min) / Math.max(most, 1);
    const power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw * 0.999);
    const out = [];
    for (let k = Math.ceil(min / step - 1e-9); k * step <= max + 1e-9 * step; k++) out.push(k * step);
    return { step, at: out };
}

export function metres(value, step) {
    const digits = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
    return (Math.abs(value) < step / 1e6 ? 0 : value).toFixed(digits).replace("-", "−");
}

// box: {x, y, w, h} of the plot in pixels; spans: [min, max] in m across and up;
// say: what a tick is called, of [across, up].
export function axes(parent, box, spans, labels, { grid = false, say = [null, null] } = {}) {
    const [across, up] = spans.map((s, i) => ticks(s[0], s[1], Math.max((i ? box.h : box.w) / 58, 2)));
    const px = (m) => box.x + ((m - spans[0][0]) / (spans[0][1] - spans[0][0])) * box.w;
    const py = (m) => box.y + box.h - ((m - spans[1][0]) / (spans[1][1] - spans[1][0])) * box.h;
    for (const m of across.at) {
        parent.append(svg("line", { class: grid ? "axis" : "frame", x1: px(m), x2: px(m),
            y1: grid ? box.y : box.y + box.h, y2: box.y + box.h + 4 }));
        parent.append(svg("text", { x: px(m), y: box.y + box.h + 15, "text-anchor": "middle" },
            metres((say[0] || ((v) => v))(m), across.step)));
    }
    for (const m of up.at) {
        parent.append(svg("line", { class: grid ? "axis" : "frame", y1: py(m), y2: py(m),
            x1: box.x - 4, x2: grid ? box.x + box.w : box.x }));
        parent.append(svg("text", { x: box.x - 7, y: py(m) + 4, "text-anchor": "end" },
            metres((say[1] || ((v) => v))(m), up.step)));
    }
    parent.append(svg("rect", { class: "frame", x: box.x, y: box.y, width: box.w, height: box.h }));
    parent.append(svg("text", { x: box.x + box.w / 2, y: box.y + box.h + 29, "text-anchor": "middle" }, labels[0]));
    parent.append(svg("text", { transform: `translate(${box.x - 34} ${box.y + box.h / 2}) rotate(-90)`,
        "text-anchor": "middle" }, labels[1]));
    return { px, py };
}

export const MARGIN = { left: 46, right: 8, top: 4, bottom: 34 };
