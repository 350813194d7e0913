// SPDX-License-Identifier: LGPL-2.1-or-later
// Shows the page's frame sets in a headset (WebXR, immersive-vr): both eyes' pictures are of one frame set, and the person stands before
// the user in life size. Browsers offer it on https pages and localhost only.
// a times b; column by column
const product = (a, b) => Float32Array.from ({ length: 16 }, (_, i) =>
  [0, 1, 2, 3].reduce ((sum, k) => sum + a[4 * k + i % 4] * b[4 * (i - i % 4) / 4 + k], 0));

export class Headset {
  // page: its renderer, camera, paint () and shown (); button: hidden where there is no headset
  constructor (page, button, say) {
    Object.assign (this, { page, button, say, session: null });
    button.onclick = () => this.session ? this.session.end () : this.enter ();
    navigator.xr?.isSessionSupported?.('immersive-vr').then ((supported) => { button.hidden = !supported; }, () => {});
  }

  async enter () {
    const { gl } = this.page.renderer;
    try {
      const session = await navigator.xr.requestSession ('immersive-vr');
      this.session = session;
      session.addEventListener ('end', () => this.leave ());
      await gl.makeXRCompatible ();
      const layer = new XRWebGLLayer (session, gl, { antialias: false });
      session.updateRenderState ({ baseLayer: layer, depthNear: 0.1, depthFar: 30 });
      const space = await session.requestReferenceSpace ('local');
      const show = (_, frame) => {
        session.requestAnimationFrame (show);
        const begin = performance.now (), pose = frame.getViewerPose (space);
        if (pose)
          this.page.shown (this.page.paint (() => this.draw (pose, layer)), begin);
      };
      session.requestAnimationFrame (show);
      this.button.textContent = 'Leave VR';
    } catch (error) {
      this.say (`The headset cannot be used: ${error.message}.`);
      this.session?.end ().catch (() => {});
    }
  }
  leave () {
    this.session = null;
    this.button.textContent = 'VR';
    this.page.draw ();
  }

  draw (pose, layer) {
    const { camera, renderer } = this.page, { framebuffer, framebufferWidth: width, framebufferHeight: height } = layer;
    for (const view of pose.views) {
      const { x, y, width: columns, height: rows } = layer.getViewport (view);
      const matrix = product (view.projectionMatrix, view.transform.inverse.matrix);
      camera.input (new Uint8Array (matrix.buffer));
      renderer.draw (this.page.picture ('rc_camera_eye', width, height, x, y, columns, rows, renderer.largest), { framebuffer, width, height, part: [x, y, columns, rows] });
    }
  }
}
