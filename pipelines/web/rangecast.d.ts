// SPDX-License-Identifier: LGPL-2.1-or-later
import type { Mesh } from 'three';

/** Address of a stream (ws:, wss:) or of a recording, or a recording. */
export type Source = string | File;
export interface OpenOptions {
  token?: string;
  /** Where a recording begins, seconds. */
  time?: number;
  paused?: boolean;
}
/** Of a recording: playing, paused; of a stream the others. */
export type State = 'empty' | 'playing' | 'paused' | 'connecting' | 'waiting' | 'receiving' | 'ended' | 'closed' | 'token';
export interface Message {
  text: string;
  kind: 'error' | 'note';
}

/** Plays without drawing. Events: loadedmetadata, play, pause, timeupdate, seeking, seeked, ended, error, frame, message, statechange, audiochange. */
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
  /** In answer to a click. */
  toggleSound (): void;
  /** The points of the current frame set as a PLY file. */
  savePoints (): Promise<ArrayBuffer | undefined>;
  close (): void;
}

export interface Orbit {
  /** Degrees. */
  azimuth: number;
  elevation: number;
  /** Metres, 0: default. */
  distance: number;
  /** Degrees, 0: default. */
  fieldOfView: number;
  /** Metres. */
  panX: number;
  panY: number;
  panZ: number;
}
/** Of the last second; times in ms. */
export interface Stats {
  frameSetsPerSecond: number;
  skipped: number;
  dropped: number | null;
  views: number;
  points: number;
  bytes: number;
  decodeTime: number;
  buildTime: number;
  drawTime: number;
  /** Of width and height that moving pictures are drawn at. */
  scale: number;
  latency?: number;
}

/** <rangecast-view>. Events: those of Player without frame, and framesetchange (detail: views, points, captureTime) after each that was drawn. */
export class RangecastView extends HTMLElement {
  src: string;
  token: string | undefined;
  orbit: Orbit;
  currentTime: number;
  readonly state: State;
  readonly paused: boolean;
  readonly ended: boolean;
  readonly seeking: boolean;
  readonly duration: number;
  readonly stats: Stats | undefined;
  readonly player: Player | null;
  load (source?: Source, options?: OpenOptions): void;
  play (): void;
  pause (): void;
  /** Shows the whole person again. */
  home (): void;
  /** A PNG with all pixels. */
  picture (): Promise<Blob | null>;
}
declare global {
  interface HTMLElementTagNameMap {
    'rangecast-view': RangecastView;
  }
}

/** gst-rangecast/three.js: an object of a WebGLRenderer's scene. */
export class RangecastObject extends Mesh {
  constructor (source?: Source, options?: OpenOptions & { lit?: boolean });
  readonly player: Player;
  open (source: Source, options?: OpenOptions): void;
  dispose (): void;
}
