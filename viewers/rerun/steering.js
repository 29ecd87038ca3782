// Sets the viewer's time, and tells the page around it which moment is shown.
// The messages are those of Rerun's viewer_control.proto (0.41): set_time_cursor is field 6 of a request.
(() => {
  const varint = number => {
    const bytes = [];
    for (; number > 127n; number >>= 7n) bytes.push(Number(number & 127n) | 128);
    return [...bytes, Number(number)];
  };
  const field = (key, bytes) => [key << 3 | 2, ...varint(BigInt(bytes.length)), ...bytes];
  const name = line => field(1, [...new TextEncoder().encode(line)]);
  const PAUSED = [5 << 3, 1];
  const request = (line, ns) => new Uint8Array(
    field(6, [...field(2, name(line)), ...field(3, [1 << 3, ...varint(BigInt(ns))]), ...PAUSED]));
  let wanted = new URLSearchParams(location.search).get("at"), settled = 0, told = "";

  async function steer() {
    // Asked for until the recording is there, and once more when its layout is.
    if (!wanted || !window._handle || settled > 1) return;
    const asked = wanted, [line, ns] = asked.split("@");
    try {
      await window._handle.viewer_control(request(line, ns));
      if (asked === wanted) settled += 1;
    } catch { /* nothing is loaded yet */ }
  }
  function shown() {
    // The cursor in the viewer's state: a timeline's name, its type, and a message with a single number, the time.
    if (!window._handle || window.parent === window) return;
    let state;
    try { state = window._handle.viewer_state(); } catch { return; }
    for (const line of ["host_time", "time"]) {
      const mark = [...field(1, name(line))];
      for (let at = 0; at + mark.length < state.length; at++) {
        if (!mark.every((byte, k) => state[at + k] === byte)) continue;
        const rest = state.subarray(at + mark.length);
        if (rest[0] !== 2 << 3 || rest[2] !== (3 << 3 | 2) || rest[4] !== 1 << 3 || rest[3] > 11) continue;
        let ns = 0n;
        for (let k = 5; k < 4 + rest[3]; k++) ns |= BigInt(rest[k] & 127) << BigInt(7 * (k - 5));
        if (told !== line + ns) window.parent.postMessage({moment: {line, ns: String(ns)}}, "*");
        told = line + ns;
        return;
      }
    }
  }
  window.addEventListener("message", event => {
    if (event.source !== window.parent || !event.data || !/^\w+@\d+$/.test(event.data.at || "")) return;
    wanted = event.data.at; settled = 0;
  });
  if (window.parent !== window) window.parent.postMessage({ready: true}, "*");
  setInterval(steer, 400);
  setInterval(shown, 400);
})();
