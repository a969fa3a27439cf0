// SPDX-License-Identifier: MIT
// From black over purple and orange to pale yellow: "inferno" (S. van der Walt and N. Smith
// 2015; polynomial by M. Zucker, both public domain), as in the pictures of anlos.
const inferno = [
    [0.0002189403691192265, 0.001651004631001012, -0.01948089843709184],
    [0.1065134194856116, 0.5639564367884091, 3.932712388889277],
    [11.60249308247187, -3.972853965665698, -15.9423941062914],
    [-41.70399613139459, 17.43639888205313, 44.35414519872813],
    [77.162935699427, -33.40235894210092, -81.80730925738993],
    [-71.31942824499214, 32.62606426397723, 73.20951985803202],
    [25.13112622477341, -12.24266895238567, -23.07032500287172],
];

function at(t) {
    return [0, 1, 2].map((c) => {
        let v = 0;
        for (let k = 6; k >= 0; k--) v = v * t + inferno[k][c];
        return Math.round(255 * Math.min(Math.max(v, 0), 1));
    });
}

// RGBA of each of 256 levels, whose shades are 0, black, to 1.
export function paletteOf(shade) {
    const out = new Uint32Array(256);
    const bytes = new Uint8Array(out.buffer);
    for (let level = 0; level < 256; level++)
        bytes.set([...at(Math.min(Math.max(shade(level), 0), 1)), 255], 4 * level);
    return out;
}

// The same of levels of stepDb, the brightest last, over a range of decibels.
export const palette = (stepDb, rangeDb) => paletteOf((level) => 1 - ((255 - level) * stepDb) / rangeDb);

export function drawLegend(canvas, rangeDb) {
    const pen = canvas.getContext("2d");
    const picture = pen.createImageData(256, 1);
    for (let i = 0; i < 256; i++) picture.data.set([...at(i / 255), 255], 4 * i);
    pen.putImageData(picture, 0, 0);
    canvas.setAttribute("aria-label",
        `Colours: black is ${Math.round(rangeDb)} dB below full scale or less, pale yellow full scale`);
}
