// SPDX-License-Identifier: MIT
// The plan view: what stands where, seen from above.
import { axes, svg } from "./axes.js";
import { createLabels } from "./labels.js";
import { SHOWN_OF_CAR, drawCar, drawObject, drawWall, enlargement, line, textOf, textOfWall } from "./marks.js";

const $ = (id) => document.getElementById(id);
let held = null; // the bounds that are shown, which do not follow each step of an object

// Those that node wall tells of, else the survey's.
export const wallsOf = ({ walls, scene }) => (walls ? walls.items : scene?.walls || []);

// Of the array: middle, ends of its line, foremost place.
function placeOfArray(scene) {
    const xs = scene.array.map((p) => p[0]);
    const ys = scene.array.map((p) => p[1]);
    const ends = [[Math.min(...xs), Math.min(...ys)], [Math.max(...xs), Math.max(...ys)]];
    const middle = [0, 1].map((i) => (ends[0][i] + ends[1][i]) / 2);
    return { ends, middle, ahead: ends[1][1] };
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

// Where sound to an object turns at the wall; null: it is not known.
function turningPoint(o, array, walls) {
    const wall = walls.find((w) => w.id === o.wall) || (o.wall ? null : walls[0]);
    return wall ? meeting(array.middle, mirror(o.at, wall), wall) : null;
}

// Around the points, a little larger; as before where that is not much too large.
function chooseBounds(points) {
    const low = [0, 1].map((i) => Math.min(...points.map((p) => p[i])));
    const high = [0, 1].map((i) => Math.max(...points.map((p) => p[i])));
    const fits = held && [0, 1].every((i) => held.low[i] <= low[i] && high[i] <= held.high[i] &&
        held.high[i] - held.low[i] < 1.5 * (high[i] - low[i]) + 0.5);
    if (fits) return held;
    const pad = 0.06 * Math.max(high[0] - low[0], high[1] - low[1], 0.5);
    held = { low: low.map((v) => v - pad), high: high.map((v) => v + pad) };
    return held;
}

// Of the drawing: the plot, and the metres that it covers.
function layOut(points, large) {
    const { low, high } = chooseBounds(points);
    const room = $("plan").clientWidth - 30;
    const box = { x: 46, y: 4, w: room - 54, h: 0 };
    const most = large ? Math.max(innerHeight - 300, 320) : Math.min(Math.max(innerHeight * 0.36, 240), 420);
    const perMetre = Math.min(box.w / (high[0] - low[0]), most / (high[1] - low[1]));
    box.h = Math.round((high[1] - low[1]) * perMetre);
    const extra = (box.w / perMetre - (high[0] - low[0])) / 2; // the width is used anyway
    return { room, box, perMetre, spans: [[low[0] - extra, high[0] + extra], [low[1], high[1]]] };
}

// The image under the plan, each voxel where it really is: the corners of its footprint
// say where the image's own go.
function drawUnder(picture, area, at, box) {
    const canvas = document.createElement("canvas");
    const dense = Math.min(devicePixelRatio || 1, 2);
    canvas.width = Math.max(box.w * dense, 1);
    canvas.height = Math.max(box.h * dense, 1);
    Object.assign(canvas.style, { left: `${box.x}px`, top: `${box.y}px`, width: `${box.w}px`, height: `${box.h}px` });
    const [origin, across, , up] = area.map((p) => [at.px(p[0]) - box.x, at.py(p[1]) - box.y]);
    const pen = canvas.getContext("2d");
    pen.imageSmoothingQuality = "high";
    pen.scale(dense, dense);
    pen.transform((across[0] - origin[0]) / picture.width, (across[1] - origin[1]) / picture.width,
        (up[0] - origin[0]) / picture.height, (up[1] - origin[1]) / picture.height, ...origin);
    pen.drawImage(picture, 0, 0);
    return canvas;
}

// The names of what stands still, where the objects have left room.
function nameThings(labels, { array, area, walls, inVehicle }, at, box) {
    for (const wall of walls) {
        const [x, y] = [at.px(wall.point[0]), at.py(wall.point[1])];
        labels.add("wall-name", Math.min(Math.max(x, box.x), box.x + box.w), Math.min(Math.max(y, box.y), box.y + box.h),
            [textOfWall(wall, walls)], { away: 8, must: true });
    }
    labels.add("", at.px(array.middle[0]), at.py(array.middle[1]), ["array"], { away: 8 });
    if (inVehicle) labels.add("", at.px(0), at.py(array.ahead - 0.45), ["vehicle"], { away: 0 });
    if (!area.length) return;
    const corner = area.reduce((a, p) => (p[0] + p[1] < a[0] + a[1] ? p : a)); // the lower left one
    labels.add("", at.px(corner[0]), at.py(corner[1]), ["imaged"], { away: 6 });
}

function nameObjects(labels, items, walls, at) {
    for (const { point, direction } of walls) // up on the page is a smaller y
        labels.keepLineFree(at.px(point[0]), at.py(point[1]), direction[0], -direction[1]);
    for (const o of items) {
        const [x, y] = [at.px(o.at[0]), at.py(o.at[1])];
        labels.keepFree(x - 6, y - 6, 12, 12);
    }
    for (const o of items)
        labels.add("object-name", at.px(o.at[0]), at.py(o.at[1]), textOf(o), { away: 11, must: true, bold: true });
}

function explain(items, views, times, picture) {
    const parts = picture ? ["Under it the image, black up to its median."] : [];
    if (items.length) parts.push(`Ellipses: where an object is with 95 % probability${times > 1 ? `, drawn ${times} times as large` : ""}.`);
    if (items.some((o) => o.velocity)) parts.push("Arrows: the motion over ground of one second; lines: of the last three.");
    if (items.some((o) => o.measurement === "predicted")) parts.push("Hollow: not seen just now.");
    if (views.length) parts.push("Thin outlines: the floor that is seen; outside nothing is claimed.");
    $("plan-legend").textContent = parts.join(" ");
}

// picture: of an image of one plane, to lie under the plan, which is large then; or null.
export function drawPlan(known, picture) {
    const { scene, objects, volume } = known;
    const plot = $("plan-plot");
    plot.hidden = !scene;
    plot.classList.toggle("imaged", Boolean(picture));
    if (!scene) held = null;
    if (!scene || $("plan").clientWidth < 130) return; // not laid out
    const things = { walls: wallsOf(known), array: placeOfArray(scene), area: volume?.footprint || [],
        inVehicle: scene.frame === "vehicle" };
    const { walls, array, area, inVehicle } = things;
    const items = (objects?.items || []).filter((o) => o.at[0] !== null && o.at[1] !== null);
    const views = objects?.views || [];
    const hits = items.map((o) => (objects.mirrored ? turningPoint(o, array, walls) : null));
    const points = [...array.ends, ...area, ...views.flatMap((view) => view.corners), ...items.map((o) => o.at), ...hits.filter(Boolean), ...walls.map((w) => w.point)];
    if (inVehicle) points.push(...SHOWN_OF_CAR.map((p) => [p[0], p[1] + array.ahead]));

    const { box, perMetre, spans } = layOut(points, picture);
    const drawing = svg("svg", { width: box.x + box.w + 8, height: box.y + box.h + 34, role: "img",
        "aria-label": `Plan with ${items.length} objects and ${walls.length} walls; the table has their places` });
    const at = axes(drawing, box, spans, inVehicle ? ["y (m), left of the vehicle", "x (m), ahead"] : ["x (m)", "z (m)"],
        { grid: true, say: [inVehicle ? (m) => -m : null, null] });
    const inside = svg("g", { "clip-path": "url(#plan-clip)" });
    drawing.append(svg("clipPath", { id: "plan-clip" },
        svg("rect", { x: box.x, y: box.y, width: box.w, height: box.h })), inside);

    if (area.length)
        inside.append(svg("polygon", { class: picture ? "plan-area imaged" : "plan-area",
            points: area.map((p) => `${at.px(p[0])},${at.py(p[1])}`).join(" ") }));
    for (const view of views)
        inside.append(svg("polygon", { class: "plan-view", points: view.corners.map((p) => `${at.px(p[0])},${at.py(p[1])}`).join(" ") }));
    if (inVehicle) inside.append(drawCar(array.ahead, at));
    inside.append(...walls.map((w) => drawWall(w, at)));
    items.forEach((o, i) => {
        if (hits[i]) inside.append(line("plan-ray", at, array.middle, hits[i]), line("plan-ray", at, hits[i], o.at));
    });
    inside.append(line("plan-array", at, ...array.ends));
    const times = enlargement(items, perMetre);
    inside.append(...items.map((o) => drawObject(o, at, perMetre, times)));
    const labels = createLabels(box);
    nameObjects(labels, items, walls, at);
    nameThings(labels, things, at, box);
    inside.append(...labels.drawn);
    explain(items, views, times, picture);
    plot.replaceChildren(...(picture && area.length === 4 ? [drawUnder(picture, area, at, box)] : []), drawing);
}
