// SPDX-License-Identifier: LGPL-2.1-or-later
// A WebSocket to rangewebsink that is made anew when it is lost. It runs in a page or a worker.
import { readFrameSet, readSpeech, ServerClock, VERSION } from './protocol.js';

const SILENCE = 3000, CLOCK_INTERVAL = 2000, FIRST_WAIT = 500, LONGEST_WAIT = 10000;

// By close code of the protocol: the message, and after how many ms to connect again.
const CLOSED = {
  1003: { text: 'The server rejected a message' },
  1009: { text: 'The server rejected a message' },
  4400: { text: 'The server rejected a message' },
  4401: { text: 'This server requires a token', token: true },
  4406: { text: 'The server uses another version of the protocol; reload this page' },
  4429: { text: 'The server refused the connection', again: LONGEST_WAIT },
};

export class Connection {
  // want: ['stream', 'audio', 'stats']; on: functions for events, each may be missing:
  //   frameSet (frameSet): see readFrameSet (), with captured in ms of this clock; it must acknowledge (frameSet) it
  //   speech (packet): see readSpeech (), with captured in ms of this clock
  //   say (text, kind): a sentence about the connection; '' removes it
  //   state (name): connecting, waiting (for frame sets), receiving, ended, closed, token
  //   audio (available): speech may be heard, or no longer
  //   stats (reports): of hosts
  constructor ({ url, token, want = ['stream'], on }) {
    Object.assign (this, { url, token, want, on });
    this.closed = false;
    this.wait = FIRST_WAIT;
    this.timers = new Set ();
    this.open ();
  }

  emit (event, ...args) { this.on[event]?.(...args); }
  say (text, kind = 'note') {
    if (text !== this.said)
      this.emit ('say', text, kind);
    this.said = text;
  }
  setState (name) {
    if (name !== this.stateName)
      this.emit ('state', name);
    this.stateName = name;
  }
  schedule (action, delay) {
    const timer = setTimeout (() => {
      this.timers.delete (timer);
      action ();
    }, delay);
    this.timers.add (timer);
    return timer;
  }
  clearTimers () {
    for (const timer of this.timers)
      clearTimeout (timer);
    this.timers.clear ();
  }

  // ---- the WebSocket ----

  open () {
    this.clearTimers ();
    this.clock = new ServerClock ();
    this.welcomed = false;
    this.any = false;
    this.counted = { received: 0, dropped: 0, slow: '' };
    this.setState ('connecting');
    this.schedule (() => this.welcomed || this.say ('Connecting to the server ...'), 1000);
    let socket;
    try {
      socket = new WebSocket (this.url, `rangecast.v${VERSION}`);
    } catch (error) {
      this.say (`${this.url} is not a valid server address: ${error.message}`, 'error');
      return this.setState ('closed');
    }
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => this.send ({ type: 'hello', version: VERSION, token: this.token ?? undefined, want: this.want });
    socket.onmessage = ({ data }) => typeof data === 'string' ? this.receiveText (data) : this.receive (data);
    socket.onclose = (event) => socket === this.socket && this.handleClose (event);
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
      return this.giveUp ('The server sent text that is not a message of the protocol.');
    const { type } = message;
    if (type === 'welcome')
      this.enter (message);
    else if (!this.welcomed)
      this.giveUp (`The server sent '${type}' before 'welcome'.`);
    else if (type === 'pong' && Number.isFinite (message.time) && Number.isFinite (message.server))
      this.clock.add (message.time, this.now (), message.server / 1000);
    else if (type === 'audio')
      this.emit ('audio', message.available === true);
    else if (type === 'end')
      this.end ();
    else if (type === 'stats' && Array.isArray (message.reports))
      this.emit ('stats', message.reports);
  }

  enter (message) {
    if (message.version !== VERSION)
      return this.giveUp (CLOSED[4406].text + '.');
    this.welcomed = true;
    this.wait = FIRST_WAIT;
    this.setState ('waiting');
    this.said = null; // hides whatever was said before
    this.say ('');
    this.emit ('audio', message.audio === true);
    this.measureClock ();
    this.watchSilence ();
  }
  end () {
    this.setState ('ended');
    this.say ('The stream has ended. Waiting for the next one.');
  }

  now () { return performance.timeOrigin + performance.now (); }
  measureClock () {
    this.send ({ type: 'ping', time: this.now () });
    this.schedule (() => this.measureClock (), this.clock.exchanges.length < 4 ? CLOCK_INTERVAL / 10 : CLOCK_INTERVAL);
  }
  watchSilence () {
    clearTimeout (this.silence);
    this.timers.delete (this.silence);
    if (this.want.includes ('stream'))
      this.silence = this.schedule (() => {
        if (this.stateName === 'ended')
          return;
        this.say (!this.any ? 'The server has no stream yet. Waiting for it.' : 'No frame sets have arrived for some seconds.');
        this.setState ('waiting');
      }, SILENCE);
  }

  handleClose ({ code, reason }) {
    const meaning = CLOSED[code] ?? { text: this.welcomed ? 'The connection was lost' : 'The server cannot be reached', again: this.wait };
    const wait = meaning.again;
    this.clearTimers ();
    this.socket = null;
    if (this.closed)
      return;
    const detail = reason && !(code === 4401 && !this.token) && reason !== meaning.text ? `: ${reason.replace (/\.$/, '')}` : '';
    if (wait === undefined) {
      this.say (`${meaning.text}${detail}.`, 'error');
      return this.setState (meaning.token ? 'token' : 'closed');
    }
    this.say (`${meaning.text}${detail}; trying again.`, 'error');
    this.setState ('connecting');
    this.wait = Math.min (2 * this.wait, LONGEST_WAIT);
    this.timers.add (setTimeout (() => this.open (), wait));
  }

  giveUp (text) {
    this.close ();
    this.say (text, 'error');
    this.setState ('closed');
  }
  // For good.
  close () {
    this.closed = true;
    this.clearTimers ();
    this.socket?.close ();
  }
  // Anew: the decoder has forgotten the stream.
  reopen () {
    const { socket } = this;
    this.socket = null;
    socket?.close ();
    this.clearTimers ();
    this.setState ('connecting');
    if (!this.closed)
      this.schedule (() => this.open (), FIRST_WAIT);
  }

  // ---- frame sets ----

  receive (buffer) {
    if (!this.welcomed)
      return this.giveUp ("The server sent a frame set before 'welcome'.");
    const speech = readSpeech (buffer), frameSet = speech ? null : readFrameSet (buffer);
    if (speech) {
      const captured = this.clock.toLocal (speech.captured);
      if (captured !== undefined)
        this.emit ('speech', { ...speech, captured });
    } else if (frameSet)
      this.deliver (frameSet);
    else
      this.giveUp ('The server sent a message that is not a frame set.');
  }

  deliver (frameSet) {
    const local = this.clock.toLocal (frameSet.sent);
    this.any = true;
    this.setState ('receiving');
    this.checkDropped (frameSet);
    this.watchSilence ();
    this.emit ('frameSet', { ...frameSet, captured: local === undefined ? this.now () : local - frameSet.delay });
  }

  // After each hundred frame sets of the stream: did the server drop most of them for this client?
  checkDropped ({ dropped }) {
    const { counted } = this, missed = dropped - counted.dropped, sum = ++counted.received + missed;
    if (sum >= 100)
      this.counted = { received: 0, dropped, slow: missed > sum / 2 ? `The connection or this device is too slow: ${missed} of ${sum} frame sets were dropped.` : '' };
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
