// The WebSocket: connects again by itself, unpacks frames, tells how it stands.
const RETRY_MS = [300, 600, 1200, 2500];
const SILENT_MS = 3500; // the server gives a sign of life every second
const TICK_MS = 1000;

function unpack(data) {
    if (typeof data === "string") return [JSON.parse(data), null];
    const length = new DataView(data).getUint32(0, true);
    const text = new TextDecoder().decode(new Uint8Array(data, 4, length));
    return [JSON.parse(text), new Uint8Array(data, 4 + length)];
}

// take(message, bytes) is called for each message, changed() when the state may be another.
export function connect(take, changed) {
    const link = { open: false, tries: 0, send: () => false };
    let socket;
    let unsent = null; // what was asked last while there was no connection
    // The silence that this page was awake to hear.  On a loaded machine it may stand still
    // itself for long, with the signs of life behind it in the queue: that is no silence.
    let silentMs = 0;
    let tickedAt = performance.now();
    const sinceTick = () => Math.min(performance.now() - tickedAt, TICK_MS);
    const heard = () => {
        silentMs = 0;
        tickedAt = performance.now();
    };

    function start() {
        socket = new WebSocket(`ws://${location.host}/live`);
        socket.binaryType = "arraybuffer";
        socket.onopen = () => {
            link.open = true;
            link.tries = 0;
            heard();
            changed();
            if (unsent) link.send(unsent);
            unsent = null;
        };
        socket.onmessage = (event) => {
            heard();
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
        if (!link.open || socket.readyState !== WebSocket.OPEN) {
            unsent = request;
            return false;
        }
        socket.send(JSON.stringify(request));
        return true;
    };
    link.silentMs = () => silentMs + sinceTick();
    setInterval(() => {
        silentMs += sinceTick();
        tickedAt = performance.now();
        if (link.open && silentMs > 3 * SILENT_MS) socket.close();
        changed();
    }, TICK_MS);
    start();
    return link;
}

export { SILENT_MS };
