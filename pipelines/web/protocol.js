// SPDX-License-Identifier: LGPL-2.1-or-later
// What docs/formats/web-protocol.md defines, without a network: headers of binary messages, the server's clock.

export const VERSION = 1;
export const MAX_FRAME_SET = 32 << 20; // bytes, as of an access unit
const HEADER = 24, UNKNOWN = 0xffffffff;

// buffer: ArrayBuffer of a message. @return fields by name, times in ms; null if it is no message of a frame set
export const readFrameSet = (buffer) => {
  const view = new DataView (buffer);
  if (buffer.byteLength < HEADER || buffer.byteLength > MAX_FRAME_SET + HEADER || view.getUint8 (0) !== 1)
    return null;
  const delay = view.getUint32 (12, true);
  return { key: Boolean (view.getUint8 (1) & 1), discontinuity: Boolean (view.getUint8 (1) & 2), frameSet: view.getUint32 (4, true),
    dropped: view.getUint32 (8, true), delay: delay === UNKNOWN ? 0 : delay / 1000, sent: Number (view.getBigUint64 (16, true)) / 1000,
    units: new Uint8Array (buffer, HEADER) };
};

const SPEECH_HEADER = 16;
// @return { number, captured (ms of the server's clock), data: Uint8Array (a packet of Opus) }; null if the message is no speech
export const readSpeech = (buffer) => {
  const view = new DataView (buffer);
  if (buffer.byteLength < SPEECH_HEADER || view.getUint8 (0) !== 2)
    return null;
  return { number: view.getUint32 (4, true), captured: Number (view.getBigUint64 (8, true)) / 1000, data: new Uint8Array (buffer, SPEECH_HEADER) };
};

// Difference of the server's clock and this one's, from the exchange that took the shortest time of the last ones.
export class ServerClock {
  constructor () { this.exchanges = []; }
  // sent, received: ms of this clock; server: ms of the server's clock
  add (sent, received, server) {
    this.exchanges.push ({ trip: received - sent, ahead: server - (sent + received) / 2 });
    if (this.exchanges.length > 16)
      this.exchanges.shift ();
  }
  // The server's time in ms of this clock; undefined before the first exchange.
  toLocal (server) {
    if (this.exchanges.length > 0)
      return server - this.exchanges.reduce ((best, exchange) => exchange.trip < best.trip ? exchange : best).ahead;
  }
}
