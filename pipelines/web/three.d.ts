// SPDX-License-Identifier: LGPL-2.1-or-later
import type { Mesh } from 'three';
import type { OpenOptions, Player, Source } from './player.js';

/** gst-rangecast/three.js: an object of a WebGLRenderer's scene. */
export class RangecastObject extends Mesh {
  constructor (source?: Source, options?: OpenOptions & { lit?: boolean });
  readonly player: Player;
  open (source: Source, options?: OpenOptions): void;
  dispose (): void;
}
