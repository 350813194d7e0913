// SPDX-License-Identifier: LGPL-2.1-or-later
// A WebSocket to rangewebsink that is made anew when it is lost. It runs in a page or a worker. A data channel, which only pages have, is
// the owner's: signal () and transmit () connect it to this.
import { FrameAssembler, MAX_FRAME_SET, ServerClock, VERSION } from './protocol.js';

const SILENCE = 3000, CLOCK_INTERVAL = 2000, FIRST_WAIT = 500, LONGEST_WAIT = 10000;

// Of the codes of the protocol: what is said, and whether to try again.
const CLOSED = {
  1003: { text: 'The server refused a message' },
  1009: { text: 'The server refused a message' },
  4400: { text: 'The server refused a message' },
  4401: { text: 'The server asks for a token', token: true },
  4406: { text: 'The server speaks another version of the protocol; reload this page' },
  4429: { text: 'The server has too many viewers', again: LONGEST_WAIT },
};

export class Connection {
  // want: ['stream', 'stats']; on: functions for events, each may be missing:
  //   frameSet (frameSet): see FrameAssembler; it must acknowledge (frameSet) it
  //   say (text, kind): a sentence about the connection; '' when all is well
  //   state (name): connecting, waiting, receiving, ended, closed, token
  //   welcome (message), stats (rows), signal (message): from the server
  constructor ({ url, token, want = ['stream'], on }) {
    Object.assign (this, { url, token, want, on });
    this.closed = false;
    this.wait = FIRST_WAIT;
    this.timers = new Set ();
    this.assemblers = {};
    this.open ();
  }

  tell (event, ...args) { this.on[event]?.(...args); }
  say (text, kind = 'note') {
    if (text !== this.said)
      this.tell ('say', text, kind);
    this.said = text;
  }
  state (name) {
    if (name !== this.stateName)
      this.tell ('state', name);
    this.stateName = name;
  }
  later (action, delay) {
    const timer = setTimeout (() => {
      this.timers.delete (timer);
      action ();
    }, delay);
    this.timers.add (timer);
    return timer;
  }
  forgetTimers () {
    for (const timer of this.timers)
      clearTimeout (timer);
    this.timers.clear ();
  }

  // ---- the WebSocket ----

  open () {
    this.forgetTimers ();
    this.clock = new ServerClock ();
    this.welcomed = false;
    this.transport = 'WebSocket';
    for (const name of ['WebSocket', 'WebRTC'])
      this.assemblers[name] = new FrameAssembler ((frameSet) => this.deliver (frameSet, name));
    this.newest = null;
    this.counted = { received: 0, dropped: 0, slow: '' };
    this.state ('connecting');
    this.later (() => this.welcomed || this.say ('Connecting to the server ...'), 1000);
    let socket;
    try {
      socket = new WebSocket (this.url, `rangecast.v${VERSION}`);
    } catch (error) {
      this.say (`${this.url} is no address of a server: ${error.message}`, 'error');
      return this.state ('closed');
    }
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => this.send ({ type: 'hello', version: VERSION, token: this.token ?? undefined, want: this.want });
    socket.onmessage = ({ data }) => typeof data === 'string' ? this.receiveText (data) : this.receive (data, 'WebSocket');
    socket.onclose = (event) => socket === this.socket && this.lost (event);
    this.socket = socket;
  }

  send (message) {
    if (this.socket?.readyState === WebSocket.OPEN)
      this.socket.send (JSON.stringify (message));
  }

  receiveText (text) {
    let message;
    try {
      message = JSON.parse (text);
    } catch {
      message = null;
    }
    if (typeof message?.type !== 'string')
      return this.giveUp ('The server sent what is no message of the protocol.');
    const { type } = message;
    if (type === 'welcome')
      this.enter (message);
    else if (!this.welcomed)
      this.giveUp (`The server sent '${type}' before 'welcome'.`);
    else if (type === 'pong' && Number.isFinite (message.time) && Number.isFinite (message.server))
      this.clock.add (message.time, this.now (), message.server / 1000);
    else if (type === 'end')
      this.end ();
    else if (type === 'stats' && Array.isArray (message.rows))
      this.tell ('stats', message.rows);
    else if (['offer', 'answer', 'candidate'].includes (type))
      this.tell ('signal', message);
  }

  enter (message) {
    if (message.version !== VERSION)
      return this.giveUp (CLOSED[4406].text + '.');
    this.welcomed = true;
    this.wait = FIRST_WAIT;
    this.state ('waiting');
    this.said = null; // hides whatever was said before
    this.say ('');
    this.tell ('welcome', message);
    this.measureClock ();
    this.watchSilence ();
  }
  end () {
    this.state ('ended');
    this.say ('The stream has ended; this page waits for the next.');
  }

  now () { return performance.timeOrigin + performance.now (); }
  measureClock () {
    this.send ({ type: 'ping', time: this.now () });
    this.later (() => this.measureClock (), this.clock.exchanges.length < 4 ? CLOCK_INTERVAL / 10 : CLOCK_INTERVAL);
  }
  watchSilence () {
    clearTimeout (this.silence);
    this.timers.delete (this.silence);
    if (this.want.includes ('stream'))
      this.silence = this.later (() => {
        if (this.stateName !== 'ended')
          this.say (this.stateName === 'receiving' ? 'No frame sets have come for some seconds.'
            : 'The server has no stream at the moment; this page waits for it.');
      }, SILENCE);
  }

  lost ({ code, reason }) {
    const meaning = CLOSED[code] ?? { text: this.welcomed ? 'The connection was lost' : 'The server cannot be reached', again: this.wait };
    const wait = meaning.again;
    this.forgetTimers ();
    this.socket = null;
    if (this.closed)
      return;
    const detail = reason && !(code === 4401 && !this.token) && reason !== meaning.text ? `: ${reason.replace (/\.$/, '')}` : '';
    if (wait === undefined) {
      this.say (`${meaning.text}${detail}.`, 'error');
      return this.state (meaning.token ? 'token' : 'closed');
    }
    this.say (`${meaning.text}${detail}; trying again.`, 'error');
    this.state ('connecting');
    this.wait = Math.min (2 * this.wait, LONGEST_WAIT);
    this.timers.add (setTimeout (() => this.open (), wait));
  }

  giveUp (text) {
    this.close ();
    this.say (text, 'error');
    this.state ('closed');
  }
  // For good.
  close () {
    this.closed = true;
    this.forgetTimers ();
    this.socket?.close ();
  }
  // Anew: the decoder has forgotten the stream.
  reopen () {
    const { socket } = this;
    this.socket = null;
    socket?.close ();
    this.forgetTimers ();
    this.state ('connecting');
    if (!this.closed)
      this.later (() => this.open (), FIRST_WAIT);
  }

  // ---- frame sets ----

  // transport: that the message came by
  receive (buffer, transport) {
    if (!this.welcomed)
      return this.giveUp ("The server sent a frame set before 'welcome'.");
    if (!this.assemblers[transport].add (buffer))
      this.giveUp (buffer.byteLength > MAX_FRAME_SET ? `The server sent ${buffer.byteLength} bytes in one message, more than a frame set may have.`
        : 'The server sent what is no frame set.');
  }

  deliver (frameSet, transport) {
    if (this.newest !== null && ((frameSet.frameSet - this.newest) | 0) <= 0)
      return; // by the other transport already
    this.newest = frameSet.frameSet;
    this.transport = transport;
    const local = this.clock.toLocal (frameSet.sent);
    this.state ('receiving');
    this.judge (frameSet);
    this.watchSilence ();
    this.tell ('frameSet', { ...frameSet, captured: local === undefined ? this.now () : local - frameSet.delay,
      transport, lost: this.assemblers[transport].lost });
  }

  // Each hundred frame sets of the stream: are most of them left out for this client?
  judge ({ dropped }) {
    const { counted } = this, missed = dropped - counted.dropped, sum = ++counted.received + missed;
    if (sum >= 100)
      this.counted = { received: 0, dropped, slow: missed > sum / 2 ? `The connection or this device is too slow: ${missed} of ${sum} frame sets were left out.` : '' };
    this.say (this.counted.slow);
  }

  acknowledge ({ frameSet }) { this.send ({ type: 'ack', frameSet }); }
  requestKey () {
    if (this.now () - (this.requested ?? 0) < 1000)
      return;
    this.requested = this.now ();
    this.send ({ type: 'key' });
  }
}
