// SPDX-License-Identifier: LGPL-2.1-or-later
// A live person or a recording as an object of a three.js scene, in the rig's coordinates (y up, metres), blended as <rangecast-view> does.
// Each camera that sees it, also each eye of a WebXR session, gets a picture with depths, which a triangle before the camera copies.
import { BufferAttribute, BufferGeometry, Matrix4, Mesh, ShaderMaterial, Texture, UniformsLib, UniformsUtils, Vector4 } from 'three';
import { Core } from './core.js';
import { Player } from './player.js';
import { WebGlRenderer } from './renderer.js';

// Nothing but here knows of a triangle: whatever else draws the mesh, draws a point.
const VERTEX = 'void main () { gl_Position = vec4 (float (gl_VertexID & 1) * 4.0 - 1.0, float (gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }';
// Outlines are drawn over what lies half a pixel beside them, whose depth is that of the nearest pixel next to them.
const FRAGMENT = `
uniform sampler2D u_colours, u_depths;
uniform ivec4 u_part;
uniform vec2 u_origin;
uniform mat4 u_view_from_clip;
uniform vec2 u_size;
uniform float opacity;
#include <common>
#include <lights_pars_begin>
float depth_at (ivec2 at) { return texelFetch (u_depths, clamp (at, u_part.xy, u_part.xy + u_part.zw - 1), 0).r; }
vec3 place (vec2 at, float depth)
{
  vec4 view = u_view_from_clip * vec4 (2.0 * at / u_size - 1.0, 2.0 * depth - 1.0, 1.0);
  return view.xyz / view.w;
}
void main ()
{
  ivec2 at = ivec2 (gl_FragCoord.xy - u_origin);
  if (any (lessThan (at, u_part.xy)) || any (greaterThanEqual (at, u_part.xy + u_part.zw)))
    discard;
  vec4 colour = texelFetch (u_colours, at, 0);
  if (colour.a <= 0.0)
    discard;
  float depth = depth_at (at);
  for (int r = 1; depth >= 1.0 && r <= 8; r++)
    for (int k = 0; k < 8; k++)
      depth = min (depth, depth_at (at + r * ivec2 ((k < 4 ? k : k + 1) % 3 - 1, (k < 4 ? k : k + 1) / 3 - 1)));
  gl_FragDepth = depth;
  vec3 light = vec3 (1.0);
#ifdef LIT
  vec2 centre = gl_FragCoord.xy - u_origin;
  vec3 right = place (centre + vec2 (2, 0), depth_at (at + ivec2 (2, 0))) - place (centre - vec2 (2, 0), depth_at (at - ivec2 (2, 0)));
  vec3 up = place (centre + vec2 (0, 2), depth_at (at + ivec2 (0, 2))) - place (centre - vec2 (0, 2), depth_at (at - ivec2 (0, 2)));
  vec3 normal = normalize (cross (right, up) + vec3 (0.0, 0.0, 1e-9));
  light = ambientLightColor * RECIPROCAL_PI;
  #if NUM_DIR_LIGHTS > 0
  for (int i = 0; i < NUM_DIR_LIGHTS; i++)
    light += RECIPROCAL_PI * max (dot (normal, directionalLights[i].direction), 0.0) * directionalLights[i].color;
  #endif
#endif
  vec3 linear = mix (colour.rgb / 12.92, pow ((colour.rgb + 0.055) / 1.055, vec3 (2.4)), vec3 (greaterThan (colour.rgb, vec3 (0.04045))));
  gl_FragColor = vec4 (linear * light, colour.a * opacity);
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}`;

export class RangecastObject extends Mesh {
  // source, options: as Player.open (); lit: by ambient and directional lights of the scene. Messages and errors are events of `player`, whose
  // 'frame' says that there is something new to render.
  constructor (source, { lit = false, ...options } = {}) {
    const geometry = new BufferGeometry ().setAttribute ('position', new BufferAttribute (new Float32Array (9), 3));
    super (geometry, new ShaderMaterial ({ vertexShader: VERTEX, fragmentShader: FRAGMENT, transparent: true, lights: lit, toneMapped: false, defines: lit ? { LIT: 1 } : {},
      uniforms: { ...UniformsUtils.clone (UniformsLib.lights), u_colours: { value: new Texture () }, u_depths: { value: new Texture () }, u_part: { value: new Vector4 () },
        u_origin: { value: [0, 0] }, u_size: { value: [1, 1] }, u_view_from_clip: { value: new Matrix4 () }, opacity: { value: 1 } } }));
    this.frustumCulled = false;
    this.pending = null; // the newest frame set, not uploaded yet
    this.painter = this.core = null;
    this.player = new Player ();
    this.player.addEventListener ('frame', ({ detail }) => { this.pending = detail; });
    this.player.ready.then ((module) => {
      if (this.disposed)
        return;
      this.core = new Core (module);
      // From above, so that no view counts as one behind the person, which would be reduced.
      this.player.setView ({ ...this.core.record ('rc_orbit'), elevation: 90, aspect: 1, fit: false });
    }, () => {});
    this.open (source, options);
  }
  open (source, options) {
    this.failed = false;
    this.player.open (source, options).catch (() => {});
  }
  raycast () {}

  onBeforeRender (renderer, scene, camera) {
    const gl = renderer.getContext (), { uniforms } = this.material;
    uniforms.u_part.value.set (0, 0, 0, 0);
    if (!this.core || this.failed || gl.isContextLost ())
      return;
    if (renderer.state.buffers.depth.getReversed?.()) {
      this.failed = true;
      return this.player.say ({ text: 'RangecastObject does not support reversedDepthBuffer.' });
    }
    if (this.painter?.gl !== gl)
      this.begin (renderer);
    const target = [renderer.getRenderTarget (), renderer.getActiveCubeFace (), renderer.getActiveMipmapLevel ()];
    const [viewport, scissor] = [gl.VIEWPORT, gl.SCISSOR_BOX].map ((name) => new Vector4 ().fromArray (gl.getParameter (name)));
    const scissored = gl.isEnabled (gl.SCISSOR_TEST);
    try {
      const { colours, depths } = this.paint (gl, camera, viewport, uniforms);
      for (const [{ value }, texture] of [[uniforms.u_colours, colours], [uniforms.u_depths, depths]]) // three never uploads them itself
        Object.assign (renderer.properties.get (value), { __webglInit: true, __webglTexture: texture });
    } catch (error) {
      this.failed = true; // and not again in each picture
      this.player.say ({ text: error.message });
    }
    renderer.resetState ();
    renderer.setRenderTarget (...target);
    renderer.state.viewport (viewport);
    renderer.state.scissor (scissor);
    renderer.state.setScissorTest (scissored);
  }
  // With the first picture, and after the context was lost.
  begin (renderer) {
    this.painter = new WebGlRenderer (null, this.core, true, renderer.getContext ());
    this.player.again ();
    renderer.domElement.addEventListener ('webglcontextrestored', () => { this.painter = null; }, { once: true });
  }
  paint (gl, camera, { x, y, z: width, w: height }, uniforms) {
    for (const test of [gl.BLEND, gl.CULL_FACE, gl.STENCIL_TEST, gl.POLYGON_OFFSET_FILL, gl.SAMPLE_ALPHA_TO_COVERAGE, gl.SCISSOR_TEST])
      gl.disable (test);
    gl.colorMask (true, true, true, true);
    gl.depthMask (true);
    gl.clearDepth (1);
    const frame = this.pending;
    if (frame) {
      this.pending = null;
      this.core.setScene (frame.state);
      this.painter.upload (frame.layers);
      this.player.shown ();
    }
    const clip = new Matrix4 ().multiplyMatrices (camera.projectionMatrix, camera.matrixWorldInverse).multiply (this.matrixWorld);
    this.core.input (new Uint8Array (Float32Array.from (clip.elements).buffer));
    this.core.call ('rc_set_clip', 64);
    const textures = this.painter.drawTextures (width, height);
    uniforms.u_part.value.fromArray (textures.part);
    uniforms.u_origin.value = [x, y];
    uniforms.u_size.value = [width, height];
    uniforms.u_view_from_clip.value.copy (camera.projectionMatrixInverse);
    return textures;
  }

  dispose () {
    this.disposed = true;
    this.player.close ();
    this.painter?.dispose ();
    this.geometry.dispose ();
    this.material.dispose ();
    this.core = this.painter = null;
  }
}
