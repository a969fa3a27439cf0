// SPDX-License-Identifier: MIT
// What is drawn on the plan: an object, a track with where it was and where it goes, a
// wall, the vehicle.
import { svg } from "./axes.js";

const WIDTH_OF_CAR = 1.8; // m; the outline is a picture, not a measurement
const LEAST_ARROW = 8; // px; a shorter one cannot be seen
const UNSEEN_S = 1; // a wall that nobody has seen for so long is drawn as one

export const SHOWN_OF_CAR = [[-WIDTH_OF_CAR / 2, -0.9], [WIDTH_OF_CAR / 2, 0]]; // from the array

export const line = (kind, at, a, b) =>
    svg("line", { class: kind, x1: at.px(a[0]), y1: at.py(a[1]), x2: at.px(b[0]), y2: at.py(b[1]) });

export function drawCar(ahead, at) {
    const [x0, x1] = [at.px(-WIDTH_OF_CAR / 2), at.px(WIDTH_OF_CAR / 2)];
    const [front, back] = [at.py(ahead - 0.03), at.py(ahead - 5)];
    const bend = Math.abs(x1 - x0) * 0.16;
    return svg("path", { class: "plan-vehicle",
        d: `M${x0} ${back}V${front + bend}Q${x0} ${front} ${x0 + bend} ${front}` +
            `H${x1 - bend}Q${x1} ${front} ${x1} ${front + bend}V${back}` });
}

// How many times as large as they are ellipses have to be drawn to be seen.
export function enlargement(items, perMetre) {
    const largest = Math.max(...items.map((o) => o.ellipse[0] * perMetre), 0);
    return largest <= 0 ? 1 : [1, 10, 100].find((k) => k * largest >= 7) || 100;
}

export const isPredicted = (o) => o.measurement === "predicted";

// The motion of a second: the arrow ends where it will be by then.
function drawArrow(o, at) {
    const tip = [0, 1].map((i) => o.at[i] + o.velocity[i]);
    const [x0, y0, x1, y1] = [at.px(o.at[0]), at.py(o.at[1]), at.px(tip[0]), at.py(tip[1])];
    const length = Math.hypot(x1 - x0, y1 - y0);
    if (length < LEAST_ARROW) return [];
    const [u, v] = [(x1 - x0) / length, (y1 - y0) / length];
    const barb = (side) => `${x1 - 8 * u + side * 4.5 * v} ${y1 - 8 * v - side * 4.5 * u}`;
    return [svg("path", { class: "plan-arrow", d: `M${x0} ${y0}L${x1} ${y1}M${barb(1)}L${x1} ${y1}L${barb(-1)}` })];
}

function drawTrail(o, at) {
    if (!(o.trail?.length > 1)) return [];
    return [svg("polyline", { class: "plan-trail",
        points: o.trail.map((p) => `${at.px(p[0])},${at.py(p[1])}`).join(" ") })];
}

export function drawObject(o, at, perMetre, times) {
    const [x, y] = [at.px(o.at[0]), at.py(o.at[1])];
    const [major, minor, angle] = o.ellipse;
    const [w, h] = o.size.map((m) => m * perMetre);
    return svg("g", { class: isPredicted(o) ? "plan-object predicted" : "plan-object", "data-id": o.id },
        ...drawTrail(o, at),
        svg("rect", { class: "plan-extent", x: x - w / 2, y: y - h / 2, width: w, height: h }),
        svg("ellipse", { class: "plan-ellipse", rx: major * perMetre * times, ry: minor * perMetre * times,
            transform: `translate(${x} ${y}) rotate(${(-angle * 180) / Math.PI})` }),
        ...(o.velocity ? drawArrow(o, at) : []),
        svg("circle", { cx: x, cy: y, r: 4 }));
}

// What stands beside an object: of a track all that fits, of others the number alone.
export function textOf(o) {
    if (!o.measurement) return [String(o.id)];
    const exists = o.existence === null ? [] : [`${Math.round(100 * o.existence)} %`];
    const first = [`${o.id}`, ...(o.shape ? [o.shape] : []), ...exists].join(" · ");
    const speed = o.speed_m_s === undefined || o.speed_m_s === null ? [] : [`${o.speed_m_s.toFixed(1)} m/s`];
    const unseen = isPredicted(o) ? [`unseen ${o.unseen_s.toFixed(1)} s`] : [];
    const second = [...speed, ...unseen].join(" · ");
    return second ? [first, second] : [first];
}

export function drawWall(wall, at) {
    const far = 100;
    const ends = wall.ends || [-far, far].map((k) => [0, 1].map((i) => wall.point[i] + k * wall.direction[i]));
    const unseen = wall.unseen_s > UNSEEN_S || wall.existence < 0.5;
    const drawn = line(unseen ? "plan-wall unseen" : "plan-wall", at, ...ends);
    drawn.dataset.id = wall.id;
    return drawn;
}

export function textOfWall(wall, all) {
    const parts = [all.length > 1 ? `wall ${wall.id}` : "wall"];
    if (wall.origin === "estimated") parts.push("heard");
    if (wall.origin === "given") parts.push("told by the vehicle");
    if (wall.sd_m > 0) parts.push(`± ${(100 * wall.sd_m).toFixed(1)} cm`);
    if (wall.unseen_s > UNSEEN_S) parts.push(`unseen ${wall.unseen_s.toFixed(0)} s`);
    return parts.join(" · ");
}
