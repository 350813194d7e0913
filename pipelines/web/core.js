// SPDX-License-Identifier: LGPL-2.1-or-later
// rangecast.wasm for JavaScript: calls, and records by the names of their fields (wasm/border.hpp). Runs in pages, workers and node.

const FIELDS = {
  rc_frame: ['views', 'pts', 'captureTime', 'bytes', 'slices', 'badSlices', 'missingPixels', 'unknownPixels', 'points'],
  rc_view: ['id', 'x', 'y', 'width', 'height', 'depth', 'colour'],
  rc_layer: ['id', 'vertices', 'size'],
  rc_recording: ['duration', 'frameDuration', 'read'],
  rc_orbit: ['azimuth', 'elevation', 'distance', 'fieldOfView', 'panX', 'panY', 'panZ', 'homeRequests'],
  rc_ply: ['address', 'size'],
  rc_scene_state: ['address', 'size'],
  rc_rig_view: ['id', 'width', 'height'],
};

export const DONE = 0, NOTHING = 1, END = 2, FAILED = 3;

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

  // @return false if no message is that long
  input (bytes) {
    const address = this.call ('rc_input', bytes.length);
    if (!address)
      return false;
    this.bytes (address, bytes.length).set (bytes);
    return true;
  }
  addUnits (bytes) {
    if (this.input (bytes))
      this.call ('rc_add_units', bytes.length);
  }
  decode () { return this.call ('rc_decode'); }
  message () { return this.text (this.call ('rc_message')); }
  frame () { return this.record ('rc_frame'); }

  // Views of the last frame set. Planes are the module's memory: read them before the next call.
  views () {
    return Array.from ({ length: this.frame ().views }, (_, i) => {
      const view = this.record ('rc_view', i), pixels = view.width * view.height;
      return { ...view, depth: new Uint16Array (this.memory.buffer, view.depth, pixels), colour: this.bytes (view.colour, 4 * pixels) };
    });
  }

  rig () { return Array.from ({ length: this.call ('rc_rig_views') }, (_, i) => this.record ('rc_rig_view', i)); }

  // @return the frame set as a PLY file, or null, which message () explains
  ply () {
    const file = this.record ('rc_ply');
    return file && this.bytes (file.address, file.size).slice ();
  }
}
