// SPDX-License-Identifier: LGPL-2.1-or-later
// Shows what a server sends, as it comes. A source of decoder.js.
import { Connection } from './connection.js';
import { DONE, FAILED, NOTHING } from './core.js';

export class LiveSource {
  // live: { url, token } of the server
  constructor (stage, live) {
    this.stage = stage;
    this.live = live;
    this.wait = 0; // ms that frame sets wait before they are decoded
    this.waiting = new Set (); // their timers
    this.due = 0; // of the last one, performance.now ()
  }

  start () {
    const { stage } = this;
    this.connection = new Connection ({ ...this.live, want: ['stream', 'audio'], on: {
      speech: (packet) => stage.post ({ type: 'hear', packet }),
      frameSet: (frameSet) => this.receive (frameSet),
      say: (text, kind) => stage.say (text, kind),
      state: (name) => this.handleState (name),
      audio: (available) => stage.post ({ type: 'sound', available }),
    } });
  }
  close () {
    this.forget ();
    this.connection.close ();
  }
  forget () {
    this.waiting.forEach (clearTimeout);
    this.waiting.clear ();
  }

  hold ({ wait }) { this.wait = wait; }
  // What waits is acknowledged before: it must not use up the server's window.
  receive (frameSet) {
    const now = performance.now ();
    this.due = Math.max (this.due, now + this.wait); // in their order
    if (this.due > now) {
      this.connection.acknowledge (frameSet);
      const timer = setTimeout (() => {
        this.waiting.delete (timer);
        this.decode (frameSet, true);
      }, this.due - now);
      this.waiting.add (timer);
    } else
      this.decode (frameSet, false);
  }

  handleState (name) {
    if (name === 'connecting') {
      this.forget (); // they are of the connection before
      this.stage.core.reset ();
    }
    this.stage.post ({ type: 'connection', state: name });
  }

  decode (frameSet, acknowledged) {
    const { core } = this.stage;
    let outcome;
    try {
      outcome = this.stage.decode (() => {
        if (frameSet.discontinuity)
          core.discontinuity ();
        core.pushUnits (frameSet.units);
        return core.next ();
      });
    } catch (error) { // a new instance of the core has no rig
      this.stage.say (error.message);
      this.connection.reopen ();
      return;
    }
    if (!acknowledged)
      this.connection.acknowledge (frameSet);
    if (outcome === FAILED) // until the next frame set
      this.connection.say (core.message (), 'error');
    if (outcome === NOTHING && core.stream ().cameras === 0)
      this.connection.say ('The stream has not described its cameras (rig) yet.');
    if (outcome !== DONE)
      return;
    if (core.frame ().unknownPixels > 0)
      this.connection.requestKey ();
    this.stage.dropped = frameSet.dropped;
    this.stage.decoded (frameSet.captured);
  }
}
