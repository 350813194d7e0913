// SPDX-License-Identifier: LGPL-2.1-or-later
// Mouse, touch and wheel move the camera, as in striprender: left button or one finger orbits; other buttons, Shift, or two fingers pan;
// wheel or the distance of two fingers zooms. move (name, ...arguments) calls a function of rangecast.wasm.
export const followPointers = (canvas, move) => {
  const down = new Map (); // by pointer: place, in pixels of the screen
  const place = (event) => ({ x: event.clientX, y: event.clientY });
  // From a to b, in pixels of the picture, whose resolution changes
  const way = (a, b) => [(b.x - a.x) * canvas.width / canvas.clientWidth, (b.y - a.y) * canvas.height / canvas.clientHeight];

  canvas.addEventListener ('pointerdown', (event) => {
    if (down.size >= 2)
      return;
    canvas.setPointerCapture (event.pointerId);
    down.set (event.pointerId, { ...place (event), pans: event.pointerType === 'mouse' && (event.button !== 0 || event.shiftKey) });
  });
  canvas.addEventListener ('pointermove', (event) => {
    const before = down.get (event.pointerId);
    if (!before)
      return;
    const now = place (event), [dx, dy] = way (before, now);
    const other = [...down].find (([id]) => id !== event.pointerId)?.[1];
    if (other)
      move ('rc_pinch', dx / 2, dy / 2, Math.hypot (...way (before, other)), Math.hypot (...way (now, other)));
    else
      move (before.pans ? 'rc_pan_by' : 'rc_orbit_by', dx, dy);
    Object.assign (before, now);
  });
  for (const end of ['pointerup', 'pointercancel', 'lostpointercapture'])
    canvas.addEventListener (end, (event) => down.delete (event.pointerId));
  canvas.addEventListener ('contextmenu', (event) => event.preventDefault ());
  canvas.addEventListener ('wheel', (event) => {
    event.preventDefault ();
    if (event.deltaY !== 0)
      move ('rc_step_nearer', event.deltaY < 0 ? 1 : 0);
  }, { passive: false });
};
