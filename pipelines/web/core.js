// SPDX-License-Identifier: LGPL-2.1-or-later
// rangecast.wasm for JavaScript: calls, and records by the names of their fields (wasm/border.hpp). Runs in pages, workers and node.

const FIELDS = {
  rc_layer: ['id', 'vertices', 'size'],
  rc_orbit: ['azimuth', 'elevation', 'distance', 'fieldOfView', 'panX', 'panY', 'panZ', 'homeRequests'],
  rc_ply: ['address', 'size'],
  rc_scene_state: ['address', 'size'],
};
// Structs of rangecast.h without struct_size; u and i: 32 bits, U: 64, d: double.
const STRUCTS = {
  stream: { cameras: 'u', framePeriod: 'U', duration: 'U' },
  frame_set: { views: 'u', number: 'U', time: 'U', captureTime: 'U', bytes: 'U', points: 'U', slices: 'U', badSlices: 'U', missingPixels: 'U', unknownPixels: 'U' },
  view: { id: 'i', x: 'i', y: 'i', width: 'i', height: 'i', depth: 'u', colour: 'u' },
  camera: { id: 'i', width: 'i', height: 'i', fx: 'd', fy: 'd', cx: 'd', cy: 'd' },
};
const NO_TIME = 2n ** 64n - 1n;
const milliseconds = (ns) => ns === Number (NO_TIME) ? -1 : ns / 1e6;

export const DONE = 0, NOTHING = 1, END = 2, FAILED = 3, FATAL = 4; // RangecastResult

// What an instance threw: a trap or a refused allocation. The instance was made anew and knows nothing of the stream.
export class CoreFailure extends Error {}

export class Core {
  // read (offset, bytes): Uint8Array of at most so many bytes of the recording
  constructor (module, read = () => new Uint8Array ()) {
    this.module = module;
    this.read = read;
    this.renewals = 0;
    this.renew ();
  }

  renew () {
    const nothing = () => 52; // ENOSYS: there are no files, no arguments, no environment
    const wasi = new Proxy ({}, { get: (_, name) => name === 'proc_exit' ? (code) => { throw new Error (`exit ${code}`); }
      : name === 'environ_sizes_get' || name === 'args_sizes_get' ? (count, size) => this.writeSizes (count, size) : nothing });
    const rangecast = { read: (offset, size, to) => {
      const bytes = this.read (offset, size);
      new Uint8Array (this.memory.buffer, to, size).set (bytes.subarray (0, size));
      return Math.min (bytes.length, size);
    } };
    this.exports = new WebAssembly.Instance (this.module, { wasi_snapshot_preview1: wasi, rangecast }).exports;
    this.memory = this.exports.memory;
    this.exports._initialize ();
    this.decoder = this.exports.rc_decoder?.(); // a fuzz target has none
  }

  writeSizes (count, size) {
    const view = new DataView (this.memory.buffer);
    view.setUint32 (count, 0, true);
    view.setUint32 (size, 0, true);
    return 0;
  }

  // Calls an exported function. After a trap the instance is a new one.
  call (name, ...args) {
    try {
      return this.exports[name] (...args);
    } catch (error) {
      this.renewals++;
      this.renew ();
      throw new CoreFailure (error instanceof WebAssembly.RuntimeError || error instanceof RangeError
        ? 'The decoder ran out of memory or failed, and was restarted.' : String (error), { cause: error });
    }
  }

  doubles (address, count) { return new Float64Array (this.memory.buffer, address, count); }
  floats (address, count) { return new Float32Array (this.memory.buffer, address, count); }
  bytes (address, size) { return new Uint8Array (this.memory.buffer, address, size); }
  text (address) {
    const rest = new Uint8Array (this.memory.buffer, address);
    return new TextDecoder ().decode (rest.slice (0, rest.indexOf (0)));
  }

  // A record by names, or null.
  record (name, ...args) {
    const address = this.call (name, ...args);
    if (!address)
      return null;
    const values = this.doubles (address, FIELDS[name].length);
    return Object.fromEntries (FIELDS[name].map ((field, i) => [field, values[i]]));
  }

  // A struct that a function rangecast_decoder_get_* fills, by names; null if there is none. 64-bit numbers lose their last bits.
  struct (name, ...args) {
    const address = this.call ('rc_struct'), view = new DataView (this.memory.buffer, address, 256);
    view.setUint32 (0, 256, true);
    if (this.call (`rangecast_decoder_get_${name}`, this.decoder, ...args, address) !== DONE)
      return null;
    let at = 4;
    return Object.fromEntries (Object.entries (STRUCTS[name]).map (([field, type]) => {
      const size = type === 'U' || type === 'd' ? 8 : 4, place = Math.ceil (at / size) * size;
      at = place + size;
      return [field, type === 'u' ? view.getUint32 (place, true) : type === 'i' ? view.getInt32 (place, true)
        : type === 'd' ? view.getFloat64 (place, true) : Number (view.getBigUint64 (place, true))];
    }));
  }

  // @return false if no message is that long
  input (bytes) {
    const address = this.call ('rc_input', bytes.length);
    if (!address)
      return false;
    this.bytes (address, bytes.length).set (bytes);
    return true;
  }
  // state: what rc_scene_state gave in another instance
  setScene (state) {
    if (this.input (new Uint8Array (state)))
      this.call ('rc_camera_scene', state.byteLength);
  }
  // Units of an access unit.
  pushUnits (bytes) {
    if (this.input (bytes))
      this.call ('rangecast_decoder_push_units', this.decoder, this.call ('rc_input', bytes.length), bytes.length);
  }
  next () { return this.call ('rangecast_decoder_next', this.decoder); }
  seek (ms) { return this.call ('rangecast_decoder_seek', this.decoder, BigInt (Math.round (Math.min (Math.max (0, ms), 1e12) * 1e6))); }
  discontinuity () { this.call ('rangecast_decoder_discontinuity', this.decoder); }
  reset () { this.call ('rangecast_decoder_reset', this.decoder); }
  message () { return this.text (this.call ('rangecast_decoder_get_message', this.decoder)); }

  // Times in ms; -1: unknown.
  stream () {
    const stream = this.struct ('stream');
    return { ...stream, framePeriod: stream.framePeriod / 1e6, duration: milliseconds (stream.duration) };
  }
  frame () {
    const frame = this.struct ('frame_set');
    return { ...frame, time: milliseconds (frame.time), captureTime: frame.captureTime / 1e6 };
  }

  // Views of the last frame set. Planes are the module's memory: read them before the next call.
  views () {
    return Array.from ({ length: this.frame ().views }, (_, i) => {
      const view = this.struct ('view', i), pixels = view.width * view.height;
      return { ...view, depth: new Uint16Array (this.memory.buffer, view.depth, pixels), colour: this.bytes (view.colour, 4 * pixels) };
    });
  }

  rig () { return Array.from ({ length: this.stream ().cameras }, (_, i) => this.struct ('camera', i)); }

  // @return the frame set as a PLY file, or null, which message () explains
  ply () {
    const file = this.record ('rc_ply');
    return file && this.bytes (file.address, file.size).slice ();
  }
}
