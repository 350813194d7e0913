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
    this.generation = 0; // of connections
    this.due = 0; // of the last one, performance.now ()
  }

  start () {
    const { stage } = this;
    this.connection = new Connection ({ ...this.live, want: ['stream', 'audio'], on: {
      speech: (packet) => stage.post ({ type: 'hear', packet }),
      frameSet: (frameSet) => this.receive (frameSet),
      say: (text, kind) => stage.say (text, kind),
      state: (name) => this.handleState (name),
      audio: (available) => stage.post ({ type: 'audio', available }),
      welcome: (message) => stage.post ({ type: 'welcome', rtc: message.rtc === true, iceServers: message.iceServers }),
      signal: (message) => stage.post ({ type: 'signal', message }),
    } });
  }
  close () {
    this.closed = true;
    this.connection.close ();
  }

  hold ({ wait }) { this.wait = wait; }
  receive (frameSet) {
    if (this.wait > 0) // else when it is decoded; waiting must not use up the server's window
      this.connection.acknowledge (frameSet);
    const now = performance.now (), acknowledged = this.wait > 0;
    this.due = Math.max (this.due, now + this.wait); // in their order
    if (this.due <= now)
      this.decode (frameSet, acknowledged);
    else {
      const { generation } = this;
      setTimeout (() => this.closed || generation !== this.generation || this.decode (frameSet, acknowledged), this.due - now);
    }
  }

  handleState (name) {
    if (name === 'connecting')
      this.generation++; // what waits is of the connection before
    if (name === 'connecting')
      this.stage.core.call ('rc_forget_stream');
    this.stage.post ({ type: 'live', state: name });
  }

  decode (frameSet, acknowledged) {
    const { core } = this.stage;
    let outcome;
    try {
      outcome = this.stage.decode (() => {
        if (frameSet.discontinuity)
          core.call ('rc_forget_references');
        for (const units of frameSet.units)
          core.addUnits (units);
        return core.decode ();
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
    if (outcome === NOTHING && core.call ('rc_rig_views') === 0)
      this.connection.say ('The stream has not described its cameras (rig) yet.');
    if (outcome !== DONE)
      return;
    if (core.frame ().unknownPixels > 0)
      this.connection.requestKey ();
    const { transport, dropped, lost, count, units } = frameSet;
    this.stage.network = { transport, dropped, lost, absent: count - units.length }; // messages
    this.stage.decoded (frameSet.captured);
  }

  // ---- the page's data channel ----

  signal ({ message }) { this.connection.send (message); }
  transmit ({ data }) {
    if (this.connection.welcomed) // else it is of the connection before
      this.connection.receive (data, 'WebRTC');
  }
}
