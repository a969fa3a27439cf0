// SPDX-License-Identifier: MIT
// The image from three sides, with axes in metres, the objects as they are imaged, and a
// slice of the front view.
import { MARGIN, axes, metres, svg } from "./axes.js";
import { drawLegend, palette, paletteOf } from "./colour.js";
import { createLabels } from "./labels.js";

// across, up: axes 0..2; data of a side: [up][across], of yz: [across][up].
const SIDES = {
    xy: { across: 0, up: 1, labels: ["x (m)", "y (m)"] },
    xz: { across: 0, up: 2, labels: ["x (m)", "z (m)"] },
    yz: { across: 2, up: 1, labels: ["z (m)", "y (m)"], turned: true },
};
const STANDS_OUT_DB = 20; // above the median
const $ = (id) => document.getElementById(id);
const narrow = matchMedia("(max-width: 899px)");

export function createImage(link) {
    const image = { volume: null, data: {}, slice: null, objects: null, chosen: "xy", depths: 0 };
    let colours = palette(0.25, 25);
    let coloursDb = 25; // the range that they are of

    // What is chosen, but no more than down to the noise: that is never drawn as an image.
    const rangeDb = () => {
        const noise = image.volume?.noise_db ?? null;
        return noise === null ? Number($("range").value) : Math.min(Number($("range").value), -noise);
    };
    const chooseColours = () => {
        if (rangeDb() === coloursDb) return;
        coloursDb = rangeDb();
        colours = palette(image.volume?.step_db || 0.25, coloursDb);
        drawLegend($("legend"), coloursDb);
    };
    // What full scale is, in absolute terms.
    const scaleText = () => {
        const { noise_db: noise, brightest_db: brightest } = image.volume;
        if (brightest === null) return "All is dark.";
        if (noise === null) return "0 dB: the brightest.";
        const above = Math.round(brightest - noise);
        return brightest < -0.5 ? `0 dB: ${Math.round(-noise)} dB above the noise; the brightest is ${above}.`
            : `0 dB: the brightest, ${above} dB above the noise.`;
    };
    // A volume of one plane has one side only that is worth a look.
    const isFlat = () => image.volume?.n[1] === 1;
    const showsSlice = () => $("front-one").checked && !isFlat();
    const chosen = () => (isFlat() ? "xz" : image.chosen);
    const span = (axis) => {
        const v = image.volume;
        const low = v.origin_m[axis] - 0.5 * v.step_m[axis];
        return [low, low + v.n[axis] * v.step_m[axis]];
    };
    const depthOf = (k) => image.volume.origin_m[2] + k * image.volume.step_m[2];

    image.take = (head, bytes) => {
        if (head.none) {
            image.volume = null;
            return;
        }
        const [nx, ny, nz] = head.n;
        image.volume = head;
        image.data.xy = bytes.subarray(0, nx * ny);
        image.data.xz = bytes.subarray(nx * ny, nx * ny + nx * nz);
        image.data.yz = bytes.subarray(nx * ny + nx * nz);
        if (image.depths !== nz) {
            image.depths = nz;
            $("depth").max = nz - 1;
            $("depth").value = Math.floor(brightest(nx, nz));
        }
        askForSlice();
    };
    // The depth of the brightest voxel, to start with.
    const brightest = (nx, nz) => {
        const top = image.data.xz.reduce((most, level) => Math.max(most, level), 0);
        return top ? image.data.xz.indexOf(top) / nx : nz / 2;
    };
    image.takeSlice = (head, bytes) => {
        if (!image.volume || head.id !== image.volume.id) return;
        image.slice = bytes;
        image.draw();
    };
    const askForSlice = () => {
        if (image.volume && showsSlice()) link.send({ slice: Number($("depth").value) });
    };

    // Pixels for a metre, the same for all sides.
    const scale = () => {
        const [x, y, z] = [0, 1, 2].map((a) => span(a)[1] - span(a)[0]);
        const room = $("image").clientWidth - 30;
        const side = MARGIN.left + MARGIN.right;
        if (narrow.matches || isFlat()) {
            const { across, up } = SIDES[chosen()];
            const size = [x, y, z];
            return Math.min((room - side) / size[across], 420 / size[up]);
        }
        const height = Math.max(innerHeight - 190, 460) - 2 * (MARGIN.top + MARGIN.bottom + 20);
        return Math.min((room - 14 - 2 * side) / (x + z), height / (y + z));
    };

    // A pixel for each sample, up falling as on a page, or rising.
    const pixelsOf = (name, data, rising, shade) => {
        const shades = shade ? paletteOf(shade) : colours;
        const { across, up, turned } = SIDES[name];
        const [w, h] = [image.volume.n[across], image.volume.n[up]];
        const picture = new ImageData(w, h);
        const pixels = new Uint32Array(picture.data.buffer);
        for (let row = 0; row < h; row++) {
            const v = rising ? row : h - 1 - row;
            for (let u = 0; u < w; u++)
                pixels[row * w + u] = shades[turned ? data[u * h + v] : data[v * w + u]];
        }
        const small = new OffscreenCanvas(w, h);
        small.getContext("2d").putImageData(picture, 0, 0);
        return small;
    };

    const paint = (canvas, name, data) => {
        const pen = canvas.getContext("2d");
        pen.imageSmoothingQuality = "high";
        pen.drawImage(pixelsOf(name, data, false), 0, 0, canvas.width, canvas.height);
    };

    // For the plan, of an image of one plane: [z][x], black up to its median, so that noise
    // stays dark where nothing stands out.  null: it is none.
    image.plane = () => {
        if (!isFlat()) return null;
        const counts = new Uint32Array(256);
        for (const level of image.data.xz) counts[level]++;
        let [median, left] = [1, (image.data.xz.length - counts[0]) / 2]; // 0: not heard
        while (median < 255 && (left -= counts[median]) > 0) median++;
        const span = Math.max(255 - median, STANDS_OUT_DB / image.volume.step_db);
        return pixelsOf("xz", image.data.xz, true, (level) => (level - median) / span);
    };

    const marks = (parent, { across, up }, at, box) => {
        const labels = createLabels(box);
        const all = (image.objects?.items || []).map((o) => ({ id: o.id, x: at.px(o.virtual_m[across]),
            y: at.py(o.virtual_m[up]), known: o.virtual_m[across] !== null && o.virtual_m[up] !== null }));
        const shown = all.filter((o) => o.known && o.x >= box.x && o.x <= box.x + box.w &&
            o.y >= box.y && o.y <= box.y + box.h);
        for (const o of shown) labels.keepFree(o.x - 11, o.y - 11, 22, 22);
        for (const o of shown) {
            parent.append(svg("g", { class: "mark", "data-id": o.id }, svg("circle", { cx: o.x, cy: o.y, r: 11 })));
            labels.add("mark-name", o.x, o.y, [String(o.id)], { away: 12, must: true, bold: true });
        }
        parent.append(...labels.drawn);
    };

    const drawSide = (name, perMetre) => {
        const { across, up, labels } = SIDES[name];
        const spans = [span(across), span(up)];
        const box = { x: MARGIN.left, y: MARGIN.top,
            w: Math.round((spans[0][1] - spans[0][0]) * perMetre),
            h: Math.round((spans[1][1] - spans[1][0]) * perMetre) };
        const plot = $(`view-${name}`).querySelector(".plot");
        const size = [MARGIN.left + box.w + MARGIN.right, MARGIN.top + box.h + MARGIN.bottom];
        plot.style.width = `${size[0]}px`;
        plot.style.height = `${size[1]}px`;
        const canvas = document.createElement("canvas");
        const dense = Math.min(devicePixelRatio || 1, 2);
        canvas.width = Math.max(box.w * dense, 1);
        canvas.height = Math.max(box.h * dense, 1);
        Object.assign(canvas.style, { left: `${box.x}px`, top: `${box.y}px`,
            width: `${box.w}px`, height: `${box.h}px` });
        const sliced = name === "xy" && showsSlice() && image.slice?.length === image.data.xy.length;
        paint(canvas, name, sliced ? image.slice : image.data[name]);
        const lines = svg("svg", { width: size[0], height: size[1], role: "img",
            "aria-labelledby": `caption-${name}` });
        const at = axes(lines, box, spans, labels);
        if (name !== "xy" && showsSlice()) {
            const z = depthOf(Number($("depth").value));
            lines.append(name === "xz"
                ? svg("line", { class: "depth", x1: box.x, x2: box.x + box.w, y1: at.py(z), y2: at.py(z) })
                : svg("line", { class: "depth", x1: at.px(z), x2: at.px(z), y1: box.y, y2: box.y + box.h }));
        }
        marks(lines, SIDES[name], at, box);
        plot.replaceChildren(canvas, lines);
    };

    const captions = () => {
        const z = metres(depthOf(Number($("depth").value)), image.volume.step_m[2]);
        $("depth-text").value = `z = ${z} m`;
        $("depth").setAttribute("aria-valuetext", `${z} metres`);
        $("caption-xy").textContent = showsSlice() ? `Front, slice at z = ${z} m` : "Front, maximum over z";
        $("caption-xz").textContent = isFlat() ? "From above, as it is imaged: mirrored" : "Above, maximum over y";
        $("view-xy").dataset.shows = showsSlice() ? "slice" : "maximum";
        $("legend-low").textContent = `−${Math.round(rangeDb())}`;
        $("legend-text").textContent = scaleText();
    };

    image.draw = () => {
        $("views").hidden = !image.volume;
        document.body.classList.toggle("flat", isFlat());
        if (!image.volume) return;
        chooseColours();
        captions();
        const perMetre = scale();
        if (perMetre <= 0) return; // not laid out
        for (const name of Object.keys(SIDES)) {
            $(`view-${name}`).classList.toggle("chosen", name === chosen());
            if (!(narrow.matches || isFlat()) || name === chosen()) drawSide(name, perMetre);
        }
    };

    const choose = (name, focus) => {
        image.chosen = name;
        for (const tab of $("tabs").children) {
            const mine = tab.id === `tab-${name}`;
            tab.setAttribute("aria-selected", mine);
            tab.tabIndex = mine ? 0 : -1;
            if (mine && focus) tab.focus();
        }
        image.draw();
    };
    const wireTabs = () => {
        const tabs = [...$("tabs").children];
        tabs.forEach((tab, i) => {
            tab.onclick = () => choose(tab.id.slice(4), false);
            tab.onkeydown = (event) => {
                const step = { ArrowRight: 1, ArrowLeft: -1, Home: -i, End: tabs.length - 1 - i }[event.key];
                if (step === undefined) return;
                event.preventDefault();
                choose(tabs[(i + step + tabs.length) % tabs.length].id.slice(4), true);
            };
        });
    };
    const wire = () => {
        wireTabs();
        $("depth").oninput = () => {
            $("front-one").checked = true;
            askForSlice();
            image.draw();
        };
        for (const id of ["front-all", "front-one"])
            $(id).onchange = () => {
                askForSlice();
                image.draw();
            };
        $("range").onchange = () => image.draw();
        drawLegend($("legend"), coloursDb);
        new ResizeObserver(() => image.draw()).observe($("image"));
        narrow.onchange = () => image.draw();
    };
    wire();
    return image;
}
