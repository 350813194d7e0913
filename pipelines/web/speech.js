// SPDX-License-Identifier: LGPL-2.1-or-later
// Plays packets of speech so that they are heard when the picture of the same moment is seen. Decoder and clock are the browser's (WebCodecs,
// Web Audio).

const RATE = 48000, MARGIN = 20; // ms between the arrival of the latest packets and the loudspeaker
const STEP = 0.02; // s that sound may be off until it jumps into place
const MEMORY = 0.998; // of the latest arrival, for each packet of 20 ms: it is halved within 7 s
const HOLD_STEP = 5, MAX_HOLD = 500; // ms

const now = () => performance.timeOrigin + performance.now ();

export class Speech {
  // say (text, kind): shows a sentence; hold (ms): has frame sets wait so long before they are decoded
  constructor (say, hold) {
    this.say = say;
    this.hold = hold;
    this.held = 0; // ms, what was asked for last
    this.context = null;
    this.seen = 0; // ms from capture to the picture
    this.arrival = 0; // ms from capture to here, of late packets
    this.next = 0; // time of the context at which what was scheduled ends
    this.delay = 0; // ms from capture to the loudspeaker, of the last packet
  }
  get isOn () { return this.context !== null; }

  // In answer to a click, without which browsers play nothing.
  toggle () {
    if (this.isOn)
      return this.stop ();
    if (!('AudioDecoder' in globalThis))
      return this.say (isSecureContext ? 'This browser cannot decode the sound (WebCodecs).' : 'Browsers play the sound only over https or from localhost.', 'note');
    this.context = new AudioContext ({ latencyHint: 'interactive', sampleRate: RATE });
    this.destination = this.context.createGain ();
    this.destination.connect (this.context.destination);
    this.context.resume ();
    this.open ();
  }
  stop () {
    if (this.decoder.state !== 'closed')
      this.decoder.close ();
    this.context.close ();
    this.context = null;
    this.holdPicture (0);
    this.seen = this.arrival = 0;
  }
  open () {
    this.decoding = []; // when the packets were captured that the decoder has
    this.decoder = new AudioDecoder ({ output: (audio) => this.schedule (audio), error: (error) => this.fail (error) });
    this.decoder.configure ({ codec: 'opus', sampleRate: RATE, numberOfChannels: 2 });
  }
  fail (error) {
    this.say (`The sound cannot be decoded: ${error.message}`, 'note');
    if (this.isOn)
      this.open ();
  }

  // latency: ms from capture until a frame set was seen
  follow (latency) {
    this.seen = this.seen === 0 || Math.abs (latency - this.seen) > 1000 ? latency : this.seen + (latency - this.seen) / 16;
  }
  // captured: ms since the epoch; data: a packet of Opus; live: packets may arrive late; otherwise they arrive before they are due
  add ({ captured, data }, live) {
    if (!this.isOn || this.context.state !== 'running')
      return;
    const arrival = live ? now () - captured : 0;
    this.arrival = this.arrival === 0 || Math.abs (arrival - this.arrival) > 1000 ? arrival : Math.max (arrival, this.arrival * MEMORY);
    if (live && this.seen > 0)
      this.holdPicture (this.arrival + MARGIN - (this.seen - this.held));
    if (this.decoder.state !== 'configured')
      return;
    this.decoding.push (captured); // Chromium counts samples from the first packet's timestamp, also over gaps
    this.decoder.decode (new EncodedAudioChunk ({ type: 'key', timestamp: Math.round (1000 * captured), data }));
  }

  // Where packets take longer than pictures, pictures wait.
  holdPicture (wait) {
    const rounded = HOLD_STEP * Math.round (Math.min (Math.max (0, wait), MAX_HOLD) / HOLD_STEP);
    if (rounded === this.held)
      return;
    this.seen += rounded - this.held;
    this.hold (this.held = rounded);
  }

  // Time of the context at which a moment (ms since the epoch) is heard.
  contextTime (moment) {
    const { contextTime, performanceTime } = this.context.getOutputTimestamp ();
    return contextTime + (moment - performance.timeOrigin - performanceTime) / 1000;
  }
  schedule (audio) {
    if (!this.isOn)
      return audio.close ();
    const captured = this.decoding.shift (), wanted = Math.max (this.seen, this.arrival + MARGIN);
    const due = this.contextTime (captured + wanted);
    const at = Math.abs (due - this.next) < STEP ? this.next : due;
    if (at >= this.context.currentTime) {
      const buffer = new AudioBuffer ({ length: audio.numberOfFrames, numberOfChannels: audio.numberOfChannels, sampleRate: audio.sampleRate });
      for (let i = 0; i < audio.numberOfChannels; i++)
        audio.copyTo (buffer.getChannelData (i), { planeIndex: i, format: 'f32-planar' });
      const source = new AudioBufferSourceNode (this.context, { buffer });
      source.connect (this.destination);
      source.start (at);
      this.next = at + buffer.duration;
      this.delay = wanted + 1000 * (at - due);
    }
    audio.close ();
  }
}
