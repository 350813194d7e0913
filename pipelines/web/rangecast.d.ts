// SPDX-License-Identifier: LGPL-2.1-or-later
import type { Message, OpenOptions, Player, Source, State } from './player.js';

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
  get token (): string | undefined;
  set token (token: string | null | undefined);
  get orbit (): Orbit;
  set orbit (orbit: Partial<Orbit>);
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
  addEventListener (type: 'framesetchange', listener: (event: CustomEvent<{ views: number; points: number; captureTime: number }>) => void): void;
  addEventListener (type: 'message', listener: (event: CustomEvent<Message>) => void): void;
  addEventListener (type: 'error', listener: (event: CustomEvent<{ message: string }>) => void): void;
  addEventListener (type: string, listener: EventListenerOrEventListenerObject, options?: boolean | AddEventListenerOptions): void;
}
declare global {
  interface HTMLElementTagNameMap {
    'rangecast-view': RangecastView;
  }
}
