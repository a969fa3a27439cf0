// The WebSocket: connects again by itself, unpacks frames, tells how it stands.
const RETRY_MS = [300, 600, 1200, 2500];
const SILENT_MS = 3500; // the server gives a sign of life every second

function unpack(data) {
    if (typeof data === "string") return [JSON.parse(data), null];
    const length = new DataView(data).getUint32(0, true);
    const text = new TextDecoder().decode(new Uint8Array(data, 4, length));
    return [JSON.parse(text), new Uint8Array(data, 4 + length)];
}

// take(message, bytes) is called for each message, changed() when the state may be another.
export function connect(take, changed) {
    const link = { open: false, heardAt: 0, tries: 0, send: () => false };
    let socket;

    function start() {
        socket = new WebSocket(`ws://${location.host}/live`);
        socket.binaryType = "arraybuffer";
        socket.onopen = () => {
            link.open = true;
            link.tries = 0;
            link.heardAt = performance.now();
            changed();
        };
        socket.onmessage = (event) => {
            link.heardAt = performance.now();
            take(...unpack(event.data));
        };
        socket.onclose = () => {
            link.open = false;
            const pause = RETRY_MS[Math.min(link.tries++, RETRY_MS.length - 1)];
            changed();
            setTimeout(start, pause);
        };
    }
    link.send = (request) => {
        if (!link.open || socket.readyState !== WebSocket.OPEN) return false;
        socket.send(JSON.stringify(request));
        return true;
    };
    link.silentMs = () => performance.now() - link.heardAt;
    setInterval(() => {
        if (link.open && link.silentMs() > 3 * SILENT_MS) socket.close();
        changed();
    }, 1000);
    start();
    return link;
}

export { SILENT_MS };
