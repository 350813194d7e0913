/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * Live 3D avatars without GStreamer: decodes the neighbour code and gives depth and colour planes,
 * points or triangles. For engines, other languages, and the browser, where it is the module
 * rangecast.wasm.
 *
 *     RangecastDecoder *decoder = rangecast_decoder_new (0);
 *     rangecast_decoder_push_bytes (decoder, bytes, size);
 *     while (rangecast_decoder_next (decoder) == RANGECAST_OK)
 *       ... rangecast_decoder_get_triangles (decoder, ...);
 *     rangecast_decoder_free (decoder);
 *
 * Input is one of three: access units of a network stream, a byte stream in any pieces (a file, an
 * HTTP segment), or a file that is read at will, in which one can seek. Any input is safe: damage
 * costs the pixels that it hit, and is counted.
 *
 * Threads: a decoder may be used by one thread at a time, different ones concurrently. Nothing here
 * waits, and nothing throws.
 *
 * Versions: callers set struct_size of each struct to its sizeof; a newer library fills no more
 * than that, and leaves the rest as it is. Functions and fields are added, never changed, within
 * librangecast-1.0.
 *
 * Coordinates are those of the rig: right-handed, y up, metres. Times are nanoseconds.
 */
#ifndef RANGECAST_H
#define RANGECAST_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define RANGECAST_API __attribute__ ((visibility ("default")))
#else
#define RANGECAST_API
#endif

/** A time that is not known. */
#define RANGECAST_NO_TIME UINT64_MAX

typedef struct RangecastDecoder RangecastDecoder;

typedef enum RangecastResult {
  RANGECAST_OK = 0,
  RANGECAST_NOTHING = 1, /**< no frame set yet, or nothing to return; no error */
  RANGECAST_END = 2,     /**< of the input; the message says if it is cut off, or is empty */
  RANGECAST_ERROR = 3,   /**< this frame set or call failed, later ones may not; the message says
                              why, but for a struct_size that is missing */
  RANGECAST_FATAL = 4,   /**< the input cannot be decoded; the message says why */
} RangecastResult;

/** Reads up to @a size bytes at @a offset.
 *  @return how many; fewer than @a size only at the end, or on failure */
typedef size_t (*RangecastRead) (void *user_data, uint64_t offset, void *to, size_t size);

/** What is known of the stream. */
typedef struct RangecastStream {
  uint32_t struct_size;
  uint32_t n_cameras;    /**< of the rig; 0: it has not arrived yet */
  uint64_t frame_period; /**< 0: unknown */
  uint64_t duration;     /**< from first to last frame set; of a file, once one was decoded */
} RangecastStream;

/** A camera of the rig: a pinhole camera without distortion. A point in its frame (x right, y down,
 *  z forward) is x = (u - cx) / fx * z, y = (v - cy) / fy * z, z = depth * depth_unit. */
typedef struct RangecastCamera {
  uint32_t struct_size;
  int32_t view_id;
  int32_t width, height;       /**< of its whole image, pixels */
  double fx, fy, cx, cy;       /**< pixels; (0, 0) is the centre of the top-left pixel */
  double world_from_view[12];  /**< rotation and translation (metres), 3 x 4, row-major */
  double depth_unit;           /**< metres */
  double min_depth, max_depth; /**< metres */
} RangecastCamera;

/** The last frame set. */
typedef struct RangecastFrameSet {
  uint32_t struct_size;
  uint32_t n_views;      /**< that arrived, in order of view-id; 0: there is no frame set */
  uint64_t number;       /**< grows with each frame set of this decoder */
  uint64_t time;         /**< since the first frame set; of byte streams only */
  uint64_t capture_time; /**< on the clock that the cameras' hosts share */
  uint64_t bytes;        /**< coded */
  uint64_t n_points;     /**< valid pixels */
  uint64_t n_slices;     /**< decoded */
  uint64_t n_bad_slices; /**< damaged, or inconsistent with others */
  uint64_t n_missing;    /**< pixels in slices that did not arrive */
  uint64_t n_unknown;    /**< pixels that refer to a frame set that did not arrive: request a
                              key frame set from the sender */
} RangecastFrameSet;

/** A range image of the last frame set: the part of a camera's image that holds the person. */
typedef struct RangecastView {
  uint32_t struct_size;
  int32_t view_id;
  int32_t x, y, width, height; /**< in the camera's image, pixels */
  const uint16_t *depth;       /**< height x width, depth units; 0: no pixel */
  const uint8_t *colour;       /**< height x width x 4: R, G, B, undefined */
} RangecastView;

typedef enum RangecastFlags {
  RANGECAST_LEFT_HANDED = 1, /**< z is negated, as in Unity */
  RANGECAST_Z_UP = 2,        /**< (x, y, z) becomes (x, -z, y), as in Blender; with LEFT_HANDED
                                  (x, z, y) */
  RANGECAST_CLOCKWISE = 4,   /**< of triangles seen from outside, as in Unity and Godot */
} RangecastFlags;

/** Where the attributes of a vertex go; bytes from its beginning, -1: it has none. */
typedef struct RangecastLayout {
  uint32_t struct_size;
  uint32_t stride;    /**< bytes from one vertex to the next */
  int32_t position;   /**< 3 floats */
  int32_t normal;     /**< 3 floats, length 1 */
  int32_t colour;     /**< 4 bytes: R, G, B, 255 */
  int32_t confidence; /**< float, 0 to 1: how squarely and how far from its edges the camera sees
                           the surface; a weight for blending */
  uint32_t flags;     /**< of RangecastFlags */
  float scale;        /**< units per metre; 0: 1 */
} RangecastLayout;

/** @param n_threads  that decode; 0: the number of cores. @return NULL without memory */
RANGECAST_API RangecastDecoder *rangecast_decoder_new (uint32_t n_threads);
RANGECAST_API void rangecast_decoder_free (RangecastDecoder *decoder);
/** A sentence about the last END, ERROR or FATAL; UTF-8, valid until the next call. */
RANGECAST_API const char *rangecast_decoder_get_message (const RangecastDecoder *decoder);

/** @name Input @{ */

/** Adds whole units: an access unit or slices of it, without its access-unit header, as RTP and
 *  rangewebsink transport them. What was added since the last rangecast_decoder_next() is one frame
 *  set. */
RANGECAST_API RangecastResult rangecast_decoder_push_units (
    RangecastDecoder *decoder, const void *bytes, size_t size);
/** Adds bytes of a byte stream, such as buffers of video/x-neighbour-code with
 * alignment=access-unit or a .rcnc file.
 *  @param size  0: the stream ends here */
RANGECAST_API RangecastResult rangecast_decoder_push_bytes (
    RangecastDecoder *decoder, const void *bytes, size_t size);
/** Forgets the stream and begins with a file. @param size  bytes */
RANGECAST_API RangecastResult rangecast_decoder_open (
    RangecastDecoder *decoder, uint64_t size, RangecastRead read, void *user_data);
/** Earlier frame sets are not referred to any more: units were lost in between. */
RANGECAST_API void rangecast_decoder_discontinuity (RangecastDecoder *decoder);
/** Forgets the stream and its rig. */
RANGECAST_API void rangecast_decoder_reset (RangecastDecoder *decoder);
/** @} */

/** Decodes the next frame set.
 *  @return RANGECAST_NOTHING if more input is needed */
RANGECAST_API RangecastResult rangecast_decoder_next (RangecastDecoder *decoder);
/** Goes to the last key frame set of a file that is not later than a time.
 *  @param time  since the first frame set
 *  @return RANGECAST_NOTHING, and stays, before the first frame set and in files without times */
RANGECAST_API RangecastResult rangecast_decoder_seek (RangecastDecoder *decoder, uint64_t time);

/** @name Output
 *  RANGECAST_NOTHING: there is no such index, or no frame set. Pointers are valid until the
 *  next call that is not one of these. @{ */
RANGECAST_API RangecastResult rangecast_decoder_get_stream (
    const RangecastDecoder *decoder, RangecastStream *stream);
RANGECAST_API RangecastResult rangecast_decoder_get_camera (
    const RangecastDecoder *decoder, uint32_t index, RangecastCamera *camera);
RANGECAST_API RangecastResult rangecast_decoder_get_frame_set (
    const RangecastDecoder *decoder, RangecastFrameSet *frame_set);
RANGECAST_API RangecastResult rangecast_decoder_get_view (
    const RangecastDecoder *decoder, uint32_t index, RangecastView *view);
/** Writes the vertices and triangles of all views of the last frame set: a vertex for each valid
 *  pixel, triangles between pixels of one surface, counter-clockwise seen from outside. The
 * surfaces of several cameras overlap.
 *  @param vertices      NULL: none are wanted; n_points of them always suffice
 *  @param[out] n_vertices  NULL, or how many there are
 *  @param indices       NULL: none are wanted (points); 6 x n_points of them always suffice
 *  @param[out] n_indices   NULL, or how many there are; 0 without `indices`
 *  @return RANGECAST_ERROR if an array is too small; it is then partly written */
RANGECAST_API RangecastResult rangecast_decoder_get_triangles (RangecastDecoder *decoder,
    const RangecastLayout *layout, void *vertices, size_t max_vertices, size_t *n_vertices,
    uint32_t *indices, size_t max_indices, size_t *n_indices);
/** @} */

#ifdef __cplusplus
}
#endif
#endif
