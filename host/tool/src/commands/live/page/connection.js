// The socket to `palpate live`, which is opened again as often as it closes.

/** From one attempt to the next, ms. */
const AGAIN = 1000;

/** Calls `onMessage` with each message, and `onChange` with whether there is a connection. */
export function connect(onMessage, onChange) {
  let socket;

  function open() {
    const address = new URL("socket", location.href);
    address.protocol = "ws:";
    socket = new WebSocket(address);
    socket.addEventListener("open", () => onChange(true));
    socket.addEventListener("message", (event) => onMessage(JSON.parse(event.data)));
    socket.addEventListener("close", () => {
      onChange(false);
      setTimeout(open, AGAIN);
    });
  }

  open();
  return (request) => {
    if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(request));
  };
}
