// The plan view: what stands where, seen from above.
import { axes, svg } from "./axes.js";

const $ = (id) => document.getElementById(id);
const WIDTH_OF_CAR = 1.8; // m; the outline is a picture, not a measurement
const SHOWN_OF_CAR = 0.9;

// Of the array: middle, ends of its line, foremost place.
function placeOfArray(scene) {
    const xs = scene.array.map((p) => p[0]);
    const ys = scene.array.map((p) => p[1]);
    const ends = [[Math.min(...xs), Math.min(...ys)], [Math.max(...xs), Math.max(...ys)]];
    const middle = [0, 1].map((i) => (ends[0][i] + ends[1][i]) / 2);
    return { ends, middle, ahead: ends[1][1] };
}

function bounds(points) {
    const low = [0, 1].map((i) => Math.min(...points.map((p) => p[i])));
    const high = [0, 1].map((i) => Math.max(...points.map((p) => p[i])));
    return [low, high];
}

function mirror(p, wall) {
    const [dx, dy] = wall.direction;
    const normal = [-dy, dx];
    const far = (p[0] - wall.point[0]) * normal[0] + (p[1] - wall.point[1]) * normal[1];
    return [p[0] - 2 * far * normal[0], p[1] - 2 * far * normal[1]];
}

// Where the line from a to b meets the wall.
function meeting(a, b, wall) {
    const normal = [-wall.direction[1], wall.direction[0]];
    const side = (p) => (p[0] - wall.point[0]) * normal[0] + (p[1] - wall.point[1]) * normal[1];
    const [sa, sb] = [side(a), side(b)];
    if (Math.abs(sa - sb) < 1e-9) return null;
    const t = sa / (sa - sb);
    return [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
}

function car(array, at, inVehicle) {
    if (!inVehicle) return [];
    const [x0, x1] = [at.px(-WIDTH_OF_CAR / 2), at.px(WIDTH_OF_CAR / 2)];
    const [front, back] = [at.py(array.ahead - 0.03), at.py(array.ahead - 5)];
    const bend = Math.abs(x1 - x0) * 0.16;
    return [svg("path", { class: "plan-vehicle",
        d: `M${x0} ${back}V${front + bend}Q${x0} ${front} ${x0 + bend} ${front}` +
            `H${x1 - bend}Q${x1} ${front} ${x1} ${front + bend}V${back}` })];
}

export function drawPlan({ scene, objects, volume }) {
    const plot = $("plan-plot");
    plot.hidden = !scene;
    if (!scene) return;
    const inVehicle = scene.frame === "vehicle";
    const items = (objects?.items || []).filter((o) => o.at[0] !== null && o.at[1] !== null);
    const array = placeOfArray(scene);
    const area = volume?.footprint || [];
    const hits = scene.wall && objects?.mirrored
        ? items.map((o) => meeting(array.middle, mirror(o.at, scene.wall), scene.wall)) : [];
    const points = [...array.ends, ...area, ...items.map((o) => o.at), ...hits.filter(Boolean)];
    if (inVehicle)
        points.push([-WIDTH_OF_CAR / 2, array.ahead - SHOWN_OF_CAR], [WIDTH_OF_CAR / 2, array.ahead]);
    if (scene.wall) points.push(scene.wall.point);
    let [low, high] = bounds(points);
    const pad = 0.06 * Math.max(high[0] - low[0], high[1] - low[1], 0.5);
    low = low.map((v) => v - pad);
    high = high.map((v) => v + pad);

    const room = $("plan").clientWidth - 30;
    if (room < 100) return; // not laid out
    const box = { x: 46, y: 4, w: room - 54, h: 0 };
    const most = Math.min(Math.max(innerHeight * 0.36, 240), 420);
    const perMetre = Math.min(box.w / (high[0] - low[0]), most / (high[1] - low[1]));
    box.h = Math.round((high[1] - low[1]) * perMetre);
    const extra = (box.w / perMetre - (high[0] - low[0])) / 2; // the width is used anyway
    const spans = [[low[0] - extra, high[0] + extra], [low[1], high[1]]];
    const drawing = svg("svg", { width: box.x + box.w + 8, height: box.y + box.h + 34, role: "img",
        "aria-label": `Plan with ${items.length} objects${scene.wall ? " and the wall" : ""}; the table has their places` });
    const at = axes(drawing, box, spans, inVehicle ? ["y (m), left of the vehicle", "x (m), ahead"] : ["x (m)", "z (m)"],
        { grid: true, say: [inVehicle ? (m) => -m : null, null] });
    const clip = svg("clipPath", { id: "plan-clip" },
        svg("rect", { x: box.x, y: box.y, width: box.w, height: box.h }));
    const inside = svg("g", { "clip-path": "url(#plan-clip)" });
    drawing.append(clip, inside);
    const line = (kind, a, b) => svg("line", { class: kind, x1: at.px(a[0]), y1: at.py(a[1]), x2: at.px(b[0]), y2: at.py(b[1]) });

    if (area.length)
        inside.append(svg("polygon", { class: "plan-area",
            points: area.map((p) => `${at.px(p[0])},${at.py(p[1])}`).join(" ") }));
    inside.append(...car(array, at, inVehicle));
    if (scene.wall) {
        const { point, direction } = scene.wall;
        const far = 100;
        inside.append(line("plan-wall", [0, 1].map((i) => point[i] - far * direction[i]),
            [0, 1].map((i) => point[i] + far * direction[i])));
    }
    items.forEach((o, i) => {
        if (hits[i]) inside.append(line("plan-ray", array.middle, hits[i]), line("plan-ray", hits[i], o.at));
    });
    inside.append(line("plan-array", ...array.ends));
    const times = enlargement(items, perMetre);
    for (const o of items) inside.append(drawObject(o, at, perMetre, times));
    $("plan-legend").textContent = !items.length ? ""
        : `Ellipses: where an object is with 95 % probability${times > 1 ? `, drawn ${times} times as large` : ""}.`;
    inside.append(...names(scene, array, area, at, box, inVehicle));
    plot.replaceChildren(drawing);
}

// How many times as large as they are ellipses have to be drawn to be seen.
function enlargement(items, perMetre) {
    const largest = Math.max(...items.map((o) => o.ellipse[0] * perMetre), 0);
    return largest <= 0 ? 1 : [1, 10, 100].find((k) => k * largest >= 7) || 100;
}

function drawObject(o, at, perMetre, times) {
    const [x, y] = [at.px(o.at[0]), at.py(o.at[1])];
    const [major, minor, angle] = o.ellipse;
    const [w, h] = o.size.map((m) => m * perMetre);
    return svg("g", { class: "plan-object", "data-id": o.id },
        svg("rect", { class: "plan-extent", x: x - w / 2, y: y - h / 2, width: w, height: h }),
        svg("ellipse", { class: "plan-ellipse", rx: major * perMetre * times, ry: minor * perMetre * times,
            transform: `translate(${x} ${y}) rotate(${(-angle * 180) / Math.PI})` }),
        svg("circle", { cx: x, cy: y, r: 3 }),
        svg("text", { x: x + 10, y: y - 8 }, String(o.id)));
}

function names(scene, array, area, at, box, inVehicle) {
    const label = (p, text, anchor = "middle", dy = 0) =>
        svg("text", { class: "plan-label", x: at.px(p[0]), y: at.py(p[1]) + dy, "text-anchor": anchor }, text);
    const out = [label(array.middle, "array", "middle", -8)];
    if (inVehicle) out.push(label([0, array.ahead], "vehicle", "middle", 44));
    if (area.length) {
        const centre = area.reduce((sum, p) => sum + p[0] / area.length, 0);
        out.push(label([centre, Math.min(...area.map((p) => p[1]))], "imaged", "middle", -6));
    }
    if (scene.wall) {
        const { point, direction } = scene.wall;
        const here = [at.px(point[0]), at.py(point[1])];
        let turn = (Math.atan2(-direction[1], direction[0]) * 180) / Math.PI;
        if (turn > 90) turn -= 180;
        if (turn < -90) turn += 180;
        out.push(svg("text", { class: "plan-label", "text-anchor": "middle",
            transform: `translate(${Math.min(Math.max(here[0], box.x + 24), box.x + box.w - 24)} ${here[1]}) rotate(${turn}) translate(0 -7)` }, "wall"));
    }
    return out;
}

export function listObjects(objects) {
    const items = objects?.items || [];
    $("objects").hidden = !items.length;
    const number = (v, digits) => (v === null ? "–" : v.toFixed(digits).replace("-", "−"));
    const rows = items.map((o) => {
        const row = document.createElement("tr");
        const sd = o.sd_m.includes(null) ? null : 100 * Math.max(...o.sd_m);
        const cells = [o.id, ...o.position_m.map((v) => number(v, 2)), number(sd, 1),
            o.existence === null ? "–" : `${Math.round(100 * o.existence)} %`, `${number(o.level_db, 0)} dB`];
        cells.forEach((text, i) => {
            const cell = document.createElement("td");
            cell.textContent = text;
            if (i === 6) cell.className = "wide";
            row.append(cell);
        });
        return row;
    });
    $("objects").tBodies[0].replaceChildren(...rows);
}
