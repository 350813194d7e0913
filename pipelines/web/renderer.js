// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws frame sets as striprender does, with WebGL2 or, where that is software too or missing, in software: the same shaders or the
// same code, and the same numbers (camera.cpp). Knows nothing of streams.

// rangecast::Shader
const COVERING = 0, VERTEX = 1, FRAGMENT = 2, FINISH = 3, SUM = 4;
// Floats of rc_camera_picture: those of the picture, and of each layer.
export const HEAD = 18, LAYER = 31;
const VERTEX_BYTES = 12; // of rangecast::SurfaceVertex

class Program {
  constructor (gl, vertex, fragment) {
    this.gl = gl;
    this.program = gl.createProgram ();
    this.shaders = [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]].map (([type, source]) => {
      const shader = gl.createShader (type);
      gl.shaderSource (shader, source);
      gl.compileShader (shader);
      gl.attachShader (this.program, shader);
      gl.deleteShader (shader); // with the program
      return shader;
    });
    gl.linkProgram (this.program);
    this.places = new Map ();
  }
  use () {
    if (this.shaders)
      this.check ();
    this.gl.useProgram (this.program);
  }
  // At the first use: asking earlier blocks until the compiler has finished.
  check () {
    const gl = this.gl;
    if (!gl.getProgramParameter (this.program, gl.LINK_STATUS) && !gl.isContextLost ())
      throw new Error (`A shader does not compile or link: ${this.shaders.map ((shader) => gl.getShaderInfoLog (shader)).join (' ')} ${gl.getProgramInfoLog (this.program)}`);
    this.shaders = null;
  }
  at (name) {
    if (!this.places.has (name))
      this.places.set (name, this.gl.getUniformLocation (this.program, name));
    return this.places.get (name);
  }
}

// Whether there is a WebGL2 that is not itself software: that takes several times as long as ours.
const hasGpu = () => {
  const gl = document.createElement ('canvas').getContext ('webgl2', { failIfMajorPerformanceCaveat: true });
  const name = gl?.getParameter (gl.getExtension ('WEBGL_debug_renderer_info')?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER);
  gl?.getExtension ('WEBGL_lose_context')?.loseContext ();
  return gl && !/swiftshader|llvmpipe|softpipe|swrast|software|basic render/i.test (name);
};

// core: of the camera; kind: 'webgl' or 'software', or the better one
export const makeRenderer = (canvas, core, transparent, kind) => {
  // Kept, so that a picture can be saved at any time.
  const gl = (kind ?? (hasGpu () ? 'webgl' : 'software')) === 'webgl' && canvas.getContext ('webgl2',
    { alpha: transparent, premultipliedAlpha: false, antialias: false, depth: true, preserveDrawingBuffer: true, powerPreference: 'high-performance' });
  return gl ? new WebGlRenderer (canvas, core, transparent, gl) : new SoftwareRenderer (canvas, core, transparent);
};

class SoftwareRenderer {
  constructor (canvas, core, transparent) {
    this.canvas = canvas;
    this.core = core;
    this.transparent = transparent;
    this.context = canvas.getContext ('2d', { alpha: transparent });
    this.largest = 4096;
  }
  upload (layers) {
    layers.forEach (({ vertices }, i) => {
      const address = this.core.call ('rc_draw_layer', i, vertices.length);
      if (address)
        this.core.bytes (address, vertices.length).set (vertices);
    });
  }
  draw () {
    const { width, height } = this.canvas, address = this.core.call ('rc_draw', width, height, this.transparent ? 1 : 0, this.strips);
    this.context.putImageData (new ImageData (new Uint8ClampedArray (this.core.memory.buffer, address, 4 * width * height), width, height), 0, 0);
  }
  finished () { return Promise.resolve (); }
  close () {}
}

export class WebGlRenderer {
  constructor (canvas, core, transparent, gl) {
    this.canvas = canvas;
    this.core = core;
    this.transparent = transparent;
    this.gl = gl;
    this.start ();
  }

  // Also after the browser has lost the context and given it back.
  start () {
    const gl = this.gl;
    this.blend = this.program (VERTEX, FRAGMENT);
    this.finish = this.program (COVERING, FINISH);
    this.sums = []; // by number of cells - 1
    this.nothing = gl.createVertexArray ();
    this.objects = new Map (); // by view-id
    this.layers = [];
    this.cellTarget = this.newTarget ();
    this.sumTarget = this.newTarget ();
    this.ownTarget = this.newTarget ();
    this.largest = gl.getParameter (gl.MAX_TEXTURE_SIZE);
  }

  program (...numbers) {
    return new Program (this.gl, ...numbers.map ((number) => this.core.text (this.core.call ('rc_shader', number))));
  }

  // Takes the layers of a frame set: { id, vertices: Uint8Array }.
  upload (layers) {
    this.layers = layers.map (({ id, vertices }) => {
      const objects = this.objectsOf (id);
      this.uploadVertices (objects, vertices);
      return { objects, count: vertices.length / VERTEX_BYTES };
    });
  }

  objectsOf (id) {
    const gl = this.gl;
    if (!this.objects.has (id)) {
      const objects = { array: gl.createVertexArray (), buffer: gl.createBuffer (), capacity: 0 };
      gl.bindVertexArray (objects.array);
      gl.bindBuffer (gl.ARRAY_BUFFER, objects.buffer);
      for (const place of [0, 1, 2])
        gl.enableVertexAttribArray (place);
      gl.vertexAttribPointer (0, 2, gl.SHORT, false, VERTEX_BYTES, 0);
      gl.vertexAttribPointer (1, 1, gl.UNSIGNED_SHORT, false, VERTEX_BYTES, 4);
      gl.vertexAttribPointer (2, 4, gl.UNSIGNED_BYTE, true, VERTEX_BYTES, 8);
      this.objects.set (id, objects);
    }
    return this.objects.get (id);
  }

  uploadVertices (objects, vertices) {
    const gl = this.gl;
    gl.bindBuffer (gl.ARRAY_BUFFER, objects.buffer);
    if (vertices.length > objects.capacity) {
      objects.capacity = Math.ceil (vertices.length * 1.5);
      gl.bufferData (gl.ARRAY_BUFFER, objects.capacity, gl.DYNAMIC_DRAW);
    }
    gl.bufferSubData (gl.ARRAY_BUFFER, 0, vertices);
  }

  setNearest () {
    const gl = this.gl;
    for (const [name, value] of [[gl.TEXTURE_MIN_FILTER, gl.NEAREST], [gl.TEXTURE_MAG_FILTER, gl.NEAREST],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]])
      gl.texParameteri (gl.TEXTURE_2D, name, value);
  }

  draw () { this.drawTo (null, this.canvas.width, this.canvas.height); }
  // Draws into textures. Returns { colours (with alpha), depths (those of what is drawn), part (x, y, width, height: elsewhere is nothing) }
  drawTextures (width, height) {
    this.prepare (this.ownTarget, width, height);
    const picture = this.drawTo (this.ownTarget.framebuffer, width, height);
    return { colours: this.ownTarget.colours, depths: this.sumTarget.depths, part: picture[4] > 0 ? [...picture.subarray (8, 12)] : [0, 0, 0, 0] };
  }
  drawTo (framebuffer, width, height) {
    const { gl } = this, address = this.core.call ('rc_camera_picture', width, height, this.largest, this.strips);
    const picture = this.core.floats (address, HEAD + LAYER * this.layers.length);
    gl.bindFramebuffer (gl.FRAMEBUFFER, framebuffer);
    gl.viewport (0, 0, width, height);
    if (this.transparent)
      picture.fill (0, 0, 4);
    gl.clearColor (...picture.subarray (0, 4));
    gl.clear (gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (this.layers.length > 0 && picture[17] === this.layers.length)
      this.drawBlended (picture, framebuffer, width, height);
    else
      picture[4] = 0;
    gl.disable (gl.SCISSOR_TEST);
    return picture;
  }
  close () { this.gl.getExtension ('WEBGL_lose_context')?.loseContext (); }
  // As close (), for a context that others use.
  dispose () {
    const { gl } = this;
    for (const { program } of [this.blend, this.finish, ...this.sums.filter (Boolean)])
      gl.deleteProgram (program);
    for (const { array, buffer } of this.objects.values ()) {
      gl.deleteVertexArray (array);
      gl.deleteBuffer (buffer);
    }
    gl.deleteVertexArray (this.nothing);
    for (const target of [this.cellTarget, this.sumTarget, this.ownTarget])
      this.deleteTarget (target);
  }
  deleteTarget ({ framebuffer, colours, depths }) {
    this.gl.deleteFramebuffer (framebuffer);
    this.gl.deleteTexture (colours);
    this.gl.deleteTexture (depths);
  }
  // Resolves when the GPU has executed the commands issued so far, or its context was lost.
  finished () {
    const { gl } = this, fence = gl.fenceSync (gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush ();
    return new Promise ((resolve) => {
      // A lost context has no fences, and one that was restored does not know those of before.
      const look = () => {
        if (fence && gl.getSyncParameter (fence, gl.SYNC_STATUS) === gl.UNSIGNALED)
          setTimeout (look, 0);
        else {
          gl.deleteSync (fence);
          resolve ();
        }
      };
      setTimeout (look, 0); // its state does not change before
    });
  }

  eachLayer (picture, draw) {
    this.layers.forEach (({ objects, count }, i) => {
      if (count === 0)
        return;
      this.gl.bindVertexArray (objects.array);
      draw (picture.subarray (HEAD + LAYER * i, HEAD + LAYER * (i + 1)), objects);
      this.gl.drawArrays (this.gl.TRIANGLE_STRIP, 0, count);
    });
    this.gl.bindVertexArray (null);
  }

  newTarget () { return { width: 0, height: 0, framebuffer: null, colours: null, depths: null }; }

  // Enlarges a target, in steps, so that a person who moves does not need new textures in each picture.
  prepare (target, width, height) {
    const gl = this.gl, step = 128;
    if (target.width >= width && target.height >= height)
      return;
    this.deleteTarget (target);
    target.width = Math.max (target.width, Math.min (Math.ceil (width / step) * step, this.largest));
    target.height = Math.max (target.height, Math.min (Math.ceil (height / step) * step, this.largest));
    const texture = (internal, format, type) => {
      const made = gl.createTexture ();
      gl.bindTexture (gl.TEXTURE_2D, made);
      gl.texImage2D (gl.TEXTURE_2D, 0, internal, target.width, target.height, 0, format, type, null);
      this.setNearest ();
      return made;
    };
    gl.activeTexture (gl.TEXTURE0);
    target.framebuffer = gl.createFramebuffer ();
    target.colours = texture (gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE);
    target.depths = texture (gl.DEPTH_COMPONENT24, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT);
    gl.bindTexture (gl.TEXTURE_2D, null);
    gl.bindFramebuffer (gl.FRAMEBUFFER, target.framebuffer);
    gl.framebufferTexture2D (gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target.colours, 0);
    gl.framebufferTexture2D (gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, target.depths, 0);
    if (gl.checkFramebufferStatus (gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE && !gl.isContextLost ())
      throw new Error ('WebGL2 has no framebuffer of this size.');
  }

  bindTextures (program, target, colours) {
    const gl = this.gl;
    [[colours, target.colours], ['u_depths', target.depths]].forEach (([name, texture], unit) => {
      gl.activeTexture (gl.TEXTURE0 + unit);
      gl.bindTexture (gl.TEXTURE_2D, texture);
      gl.uniform1i (program.at (name), unit);
    });
  }
  // They are rendered to again next time.
  unbindTextures () {
    for (const unit of [1, 0]) {
      this.gl.activeTexture (this.gl.TEXTURE0 + unit);
      this.gl.bindTexture (this.gl.TEXTURE_2D, null);
    }
  }
  cover () {
    this.gl.bindVertexArray (this.nothing);
    this.gl.drawArrays (this.gl.TRIANGLES, 0, 3);
    this.gl.bindVertexArray (null);
  }

  // As SurfacePainter::draw (); the framebuffer has been cleared.
  drawBlended (picture, framebuffer, width, height) {
    const gl = this.gl, [count, columns, rows] = picture.subarray (4, 7);
    if (count === 0)
      return;
    this.prepare (this.cellTarget, columns, rows);
    this.prepare (this.sumTarget, width, height);
    gl.enable (gl.DEPTH_TEST);
    gl.enable (gl.SCISSOR_TEST);
    this.drawCells (picture, width, height, columns, rows);
    gl.viewport (0, 0, width, height);
    gl.depthFunc (gl.ALWAYS);
    this.addUp (picture, count);
    gl.disable (gl.DEPTH_TEST);
    gl.bindFramebuffer (gl.FRAMEBUFFER, framebuffer);
    this.finishPicture (picture, height);
  }

  drawCells (picture, width, height, columns, rows) {
    const gl = this.gl, [x, y, coveredColumns, coveredRows] = picture.subarray (8, 12);
    gl.bindFramebuffer (gl.FRAMEBUFFER, this.cellTarget.framebuffer);
    gl.scissor (0, 0, columns, rows);
    gl.clearColor (0, 0, 0, 0);
    gl.clear (gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.depthFunc (gl.LESS);
    gl.frontFace (picture[16] ? gl.CW : gl.CCW);
    this.blend.use ();
    this.eachLayer (picture, (layer) => {
      const [, right, down] = layer.subarray (18, 21);
      gl.viewport (right, down, width, height);
      gl.scissor (x + right, y + down, coveredColumns, coveredRows);
      gl.uniformMatrix4fv (this.blend.at ('u_clip_from_pixel'), false, layer.subarray (0, 16));
      gl.uniform2fv (this.blend.at ('u_behind'), layer.subarray (16, 18));
      gl.uniform4fv (this.blend.at ('u_lens'), layer.subarray (21, 25));
      gl.uniform3fv (this.blend.at ('u_viewer'), layer.subarray (25, 28));
      gl.uniform1f (this.blend.at ('u_unit'), layer[28]);
    });
    gl.frontFace (gl.CCW);
  }

  addUp (picture, count) {
    const gl = this.gl, cells = new Int32Array (16), cotangents = new Float32Array (16); // x, y of each cell
    this.layers.forEach ((_, i) => {
      const layer = picture.subarray (HEAD + LAYER * i), cell = layer[18];
      cells.set (layer.subarray (19, 21), 2 * cell);
      cotangents.set (layer.subarray (29, 31), 2 * cell);
    });
    gl.bindFramebuffer (gl.FRAMEBUFFER, this.sumTarget.framebuffer);
    gl.scissor (...picture.subarray (8, 12));
    const program = this.sums[count - 1] ??= this.program (COVERING, SUM + count - 1);
    program.use ();
    this.bindTextures (program, this.cellTarget, 'u_colours');
    gl.uniform2iv (program.at ('u_cells'), cells.subarray (0, 2 * count));
    gl.uniform2fv (program.at ('u_cotangents'), cotangents.subarray (0, 2 * count));
    gl.uniform3fv (program.at ('u_shift'), picture.subarray (12, 15));
    this.cover ();
    this.unbindTextures ();
  }

  finishPicture (picture, height) {
    const gl = this.gl, program = this.finish, [x, y, columns, rows] = picture.subarray (8, 12);
    program.use ();
    this.bindTextures (program, this.sumTarget, 'u_sum');
    gl.uniform4i (program.at ('u_part'), x, y, x + columns - 1, y + rows - 1);
    gl.uniform3fv (program.at ('u_shift'), picture.subarray (12, 15));
    gl.uniform1i (program.at ('u_reach'), picture[15]);
    gl.uniform1i (program.at ('u_smooth'), 1);
    gl.uniform4fv (program.at ('u_background'), picture.subarray (0, 4));
    gl.uniform3f (program.at ('u_shade'), 0, height, 0);
    this.cover ();
    this.unbindTextures ();
  }
}
