// SPDX-License-Identifier: LGPL-2.1-or-later
import type { Orbit } from './rangecast.js';

/** Address of a stream (ws:, wss:) or of a recording, or a recording. */
export type Source = string | Blob;
export interface OpenOptions {
  token?: string;
  /** Where a recording begins, seconds. */
  time?: number;
  paused?: boolean;
}
/** Of a recording: playing, paused; of a stream the others. */
export type State = 'empty' | 'playing' | 'paused' | 'connecting' | 'waiting' | 'receiving' | 'ended' | 'closed' | 'token';
export interface Message {
  /** Empty: hides the one before. */
  text: string;
  kind: 'error' | 'note';
}

/** What is to be drawn from. */
export interface PlayerView extends Orbit {
  /** Number of times the default position was asked for. */
  homeRequests: number;
  aspect: number;
  fit: boolean;
}
/** Plays without drawing: frames come after setView (), each after shown () of the one before. Events: loadedmetadata, play, pause, timeupdate, seeking, seeked, ended, error, frame, message, statechange, audiochange. */
export class Player extends EventTarget {
  readonly ready: Promise<WebAssembly.Module>;
  readonly state: State;
  readonly live: boolean;
  /** Whether the stream has sound. */
  readonly audio: boolean;
  /** Seconds; NaN: unknown, Infinity: live. */
  readonly duration: number;
  readonly paused: boolean;
  readonly ended: boolean;
  readonly seeking: boolean;
  currentTime: number;
  open (source: Source, options?: OpenOptions): Promise<void>;
  play (): void;
  pause (): void;
  setView (view: PlayerView): void;
  shown (): void;
  /** Sends the last frame again. */
  again (): void;
  /** Ends the stream or recording. */
  stop (): void;
  /** In answer to a click. */
  toggleSound (): void;
  /** The points of the current frame set as a PLY file. */
  savePoints (): Promise<ArrayBuffer | undefined>;
  close (): void;
}
