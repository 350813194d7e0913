// SPDX-License-Identifier: LGPL-2.1-or-later
// What docs/formats/web-protocol.md defines, without a transport: headers of binary messages, frame sets from messages, the server's clock.

export const VERSION = 1;
export const MAX_FRAME_SET = 32 << 20; // bytes, as of an access unit
const HEADER = 32, UNKNOWN = 0xffffffff;

// buffer: ArrayBuffer of a message. @return fields by name, times in ms; null if it is no message of a frame set
export const readMessage = (buffer) => {
  if (buffer.byteLength < HEADER)
    return null;
  const view = new DataView (buffer), delay = view.getUint32 (20, true);
  const message = { key: Boolean (view.getUint8 (1) & 1), discontinuity: Boolean (view.getUint8 (1) & 2), count: view.getUint16 (2, true),
    frameSet: view.getUint32 (4, true), index: view.getUint16 (8, true), number: view.getUint32 (12, true), dropped: view.getUint32 (16, true),
    delay: delay === UNKNOWN ? 0 : delay / 1000, sent: Number (view.getBigUint64 (24, true)) / 1000, units: new Uint8Array (buffer, HEADER) };
  message.kind = view.getUint8 (0);
  return message.kind !== 1 || message.index < message.count ? message : null;
};

const SPEECH_HEADER = 16;
// @return { number, captured (ms of the server's clock), data: Uint8Array (a packet of Opus) }; null if the message is no speech
export const readSpeech = (buffer) => {
  const view = new DataView (buffer);
  if (buffer.byteLength < SPEECH_HEADER || view.getUint8 (0) !== 2)
    return null;
  return { number: view.getUint32 (4, true), captured: Number (view.getBigUint64 (8, true)) / 1000, data: new Uint8Array (buffer, SPEECH_HEADER) };
};

// a - b of numbers modulo 2^32
const difference = (a, b) => (a - b) | 0;

// Puts frame sets together from the messages of one transport, and counts what the network lost.
export class FrameAssembler {
  // deliver ({ frameSet, key, discontinuity, dropped, sent, delay, count, units: [Uint8Array] }); those with missing messages, too
  constructor (deliver) {
    this.deliver = deliver;
    this.reset ();
  }
  reset () {
    this.last = null; // number of the last frame set that was delivered
    this.next = 0; // number of the message that should come next
    this.received = 0;
    this.resetPart ();
  }
  resetPart () {
    this.part = null;
    this.size = 0;
  }
  get lost () { return Math.max (0, this.next - this.received); }

  // @return false if the message is not one of a frame set, or the frame set is too large
  add (buffer) {
    const message = readMessage (buffer);
    if (!message)
      return false;
    if (message.kind !== 1)
      return true; // of a later version of the protocol
    this.received++;
    this.next = Math.max (this.next, message.number + 1);
    if (this.last !== null && difference (message.frameSet, this.last) <= 0)
      return true; // too late
    if (this.part && difference (message.frameSet, this.part.frameSet) < 0)
      return true;
    if (this.part && message.frameSet !== this.part.frameSet)
      this.finish ();
    this.part ??= { ...message, units: [] };
    this.size += message.units.length;
    if (this.size > MAX_FRAME_SET) {
      this.resetPart ();
      return false;
    }
    this.part.discontinuity ||= message.discontinuity;
    this.part.units.push (message.units);
    if (this.part.units.length === message.count)
      this.finish ();
    return true;
  }
  finish () {
    const { part } = this;
    this.resetPart ();
    this.last = part.frameSet;
    this.deliver (part);
  }
}

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
