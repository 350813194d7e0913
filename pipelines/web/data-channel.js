// SPDX-License-Identifier: LGPL-2.1-or-later
// The WebRTC data channel that rangewebsink offers: its messages and signals. Frame sets come over the WebSocket until it is open, and
// again when it is closed or does not open in time.
const OPEN_TIMEOUT = 8000; // ms

export class DataChannel {
  // send (message): to the server; receive (ArrayBuffer): a message of the channel; failed (): there is no channel, or no longer
  constructor (iceServers, { send, receive, failed }) {
    this.send = send;
    this.failed = failed;
    this.receive = receive;
    this.candidates = []; // that came before the offer was applied
    this.timer = setTimeout (() => this.fail (), OPEN_TIMEOUT);
    try {
      this.peer = new RTCPeerConnection ({ iceServers: iceServers ?? [] });
    } catch {
      return this.fail ();
    }
    this.peer.onicecandidate = ({ candidate }) => candidate && send ({ type: 'candidate', candidate: candidate.candidate, sdpMLineIndex: candidate.sdpMLineIndex });
    this.peer.onconnectionstatechange = () => this.peer.connectionState === 'failed' && this.fail ();
    this.peer.ondatachannel = ({ channel }) => {
      channel.binaryType = 'arraybuffer';
      channel.onopen = () => clearTimeout (this.timer);
      channel.onmessage = ({ data }) => {
        clearTimeout (this.timer);
        if (data instanceof ArrayBuffer)
          receive (data);
      };
      channel.onclose = () => this.fail ();
    };
    send ({ type: 'rtc' });
  }

  async signal ({ type, sdp, candidate, sdpMLineIndex }) {
    try {
      if (type === 'offer') {
        await this.peer.setRemoteDescription ({ type, sdp });
        await this.peer.setLocalDescription ();
        this.send ({ type: 'answer', sdp: this.peer.localDescription.sdp });
        for (const early of this.candidates.splice (0))
          await this.peer.addIceCandidate (early);
      } else if (type === 'candidate') {
        const one = { candidate, sdpMLineIndex };
        if (this.peer.remoteDescription)
          await this.peer.addIceCandidate (one);
        else
          this.candidates.push (one);
      }
    } catch (error) {
      console.warn (`WebRTC: ${error.message}`);
      if (type === 'offer')
        this.fail ();
    }
  }

  // The WebSocket goes on.
  fail () {
    if (this.closed)
      return;
    this.close ();
    this.send ({ type: 'rtc-stop' });
    this.failed ();
  }
  close () {
    this.closed = true;
    clearTimeout (this.timer);
    this.peer?.close ();
  }
}
