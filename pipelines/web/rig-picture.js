// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws cameras and points of a rig on a 2D canvas, from an orbit that the pointer moves.
const COLOURS = { good: '#56d364', late: '#f0b849', gone: '#ff7b72' };

const minus = (a, b) => a.map ((value, i) => value - b[i]);
const dot = (a, b) => a.reduce ((sum, value, i) => sum + value * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => {
  const length = Math.hypot (...a);
  return length > 0 ? a.map ((value) => value / length) : [0, 0, 1];
};
// A point of a view at pixel (u, v) and depth z, in the world. Views look along +z, y down.
const toWorld = (view, u, v, z) => {
  const p = [(u - view.cx) / view.fx * z, (v - view.cy) / view.fy * z, z];
  return [0, 1, 2].map ((row) => dot (view.rotation.slice (3 * row, 3 * row + 3), p) + view.translation[row]);
};

export class RigPicture {
  constructor (canvas) {
    this.canvas = canvas;
    this.orbit = { azimuth: 0.6, elevation: 0.5, distance: 1 };
    this.views = []; // of the rig, each with state: a key of COLOURS
    this.points = []; // [x, y, z, colour]
    canvas.onpointerdown = (event) => canvas.setPointerCapture (event.pointerId);
    canvas.onpointermove = (event) => {
      if (!event.buttons)
        return;
      this.orbit.azimuth -= event.movementX * 0.01;
      this.orbit.elevation = Math.max (-1.5, Math.min (1.5, this.orbit.elevation + event.movementY * 0.01));
      this.draw ();
    };
    canvas.onwheel = (event) => {
      event.preventDefault ();
      this.orbit.distance = Math.max (0.3, Math.min (4, this.orbit.distance * Math.exp (event.deltaY * 0.001)));
      this.draw ();
    };
    new ResizeObserver (() => this.draw ()).observe (canvas);
  }

  // decoded: Core.views () of a frame set. Keeps about that many points of all.
  samplePoints (decoded, most = 4000) {
    const all = decoded.reduce ((sum, view) => sum + view.width * view.height, 0), step = Math.max (1, Math.ceil (Math.sqrt (all / most)));
    this.points = [];
    for (const view of decoded) {
      const camera = this.views.find ((one) => one.id === view.id);
      for (let y = 0; camera && y < view.height; y += step)
        for (let x = 0; x < view.width; x += step) {
          const at = y * view.width + x;
          if (view.depth[at])
            this.points.push ([...toWorld (camera, view.x + x, view.y + y, view.depth[at] * camera.depthUnit),
              `rgb(${view.colour[4 * at]},${view.colour[4 * at + 1]},${view.colour[4 * at + 2]})`]);
        }
    }
  }

  // What the orbit turns round, and its radius: all cameras, and where they look.
  bounds () {
    const places = this.views.flatMap ((view) => [view.translation, toWorld (view, view.cx, view.cy, (view.near + view.far) / 2)]);
    const middle = [0, 1, 2].map ((axis) => {
      const values = places.map ((place) => place[axis]);
      return (Math.min (...values) + Math.max (...values)) / 2;
    });
    return { middle, radius: Math.max (0.1, ...places.map ((place) => Math.hypot (...minus (place, middle)))) };
  }

  draw () {
    const { canvas, orbit } = this, ratio = window.devicePixelRatio || 1, context = canvas.getContext ('2d');
    canvas.width = Math.max (1, canvas.clientWidth * ratio);
    canvas.height = Math.max (1, canvas.clientHeight * ratio);
    if (this.views.length === 0)
      return;
    const { middle, radius } = this.bounds (), away = 2 * radius * orbit.distance;
    const from = [Math.sin (orbit.azimuth) * Math.cos (orbit.elevation), Math.sin (orbit.elevation), Math.cos (orbit.azimuth) * Math.cos (orbit.elevation)];
    const eye = middle.map ((value, i) => value + away * from[i]);
    const ahead = unit (minus (middle, eye)), right = unit (cross (ahead, [0, 1, 0])), up = cross (right, ahead);
    const scale = 1.1 * Math.min (canvas.width, canvas.height);
    const project = (place) => {
      const p = minus (place, eye), z = dot (p, ahead);
      return z > 0.01 * radius ? [canvas.width / 2 + scale * dot (p, right) / z, canvas.height / 2 - scale * dot (p, up) / z] : null;
    };
    const line = (...places) => {
      const drawn = places.map (project);
      if (drawn.some ((place) => !place))
        return;
      context.beginPath ();
      drawn.forEach ((place) => context.lineTo (...place));
      context.stroke ();
    };
    const distance = ([x, y, z]) => dot (minus ([x, y, z], eye), ahead);
    for (const [x, y, z, colour] of [...this.points].sort ((a, b) => distance (b) - distance (a))) {
      const place = project ([x, y, z]);
      context.fillStyle = colour;
      if (place)
        context.fillRect (place[0], place[1], 3 * ratio, 3 * ratio);
    }
    context.lineWidth = 1.5 * ratio;
    context.font = `${12 * ratio}px system-ui, sans-serif`;
    for (const view of this.views) {
      context.strokeStyle = context.fillStyle = COLOURS[view.state];
      const size = 0.18 * radius, corners = [[0, 0], [view.width, 0], [view.width, view.height], [0, view.height]].map (([u, v]) => toWorld (view, u, v, size));
      line (...corners, corners[0]);
      for (const corner of corners)
        line (view.translation, corner);
      const label = project (view.translation), text = `${view.id}  ${view.label}`;
      if (label)
        context.fillText (text, Math.max (0, Math.min (canvas.width - context.measureText (text).width, label[0] + 6 * ratio)), label[1] - 6 * ratio);
    }
  }
}
