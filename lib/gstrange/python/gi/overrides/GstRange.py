# SPDX-License-Identifier: LGPL-2.1-or-later
"""NumPy arrays of range frame sets, on top of what GObject introspection gives of libgstrange.

map_views(sample) reads a frame set; new_camera(...), new_caps(cameras, fps) and new_buffer(caps, views) make one. RangeCamera
has intrinsics and pose as matrices. See docs/guide/python.md.
"""
import operator
import weakref
from fractions import Fraction

import numpy as np
from gi.repository import Gst

from ..module import get_introspection_module

GstRange = get_introspection_module("GstRange")
__all__ = ["View", "map_views", "new_buffer", "new_camera", "new_caps"]


class _Mapping:
    """Memory of a buffer, mapped for reading as long as an array of it exists."""

    def __init__(self, buffer, offset, size):
        found, index, length, skip = buffer.find_memory(offset, size)
        if not found:
            raise ValueError("range buffer: a GstRangeMeta describes planes outside of the buffer")
        self.start = offset - skip
        memory = buffer.peek_memory(index) if length == 1 else buffer.get_memory_range(index, length)
        mapped = memory.map(Gst.MapFlags.READ)
        if not isinstance(mapped, tuple):  # of python3-gst-1.0: the memory itself
            if not mapped.__parent__:
                raise ValueError("range buffer: a memory cannot be mapped for reading")
            self.data, self.memory = np.frombuffer(mapped.data, np.uint8), memory
            weakref.finalize(self, memory.unmap, mapped)  # also at exit, when __del__ would come too late for PyGObject
        else:  # of PyGObject: a copy
            if not mapped[0]:
                raise ValueError("range buffer: a memory cannot be mapped for reading")
            self.data = np.frombuffer(mapped[1].data, np.uint8)
            memory.unmap(mapped[1])
        self.address = self.data.__array_interface__["data"][0]


class _Plane:
    """NumPy keeps the object with this interface, and so the mapping, as long as it keeps any array of it."""

    def __init__(self, mapping, offset, shape, strides, typestr):
        offset -= mapping.start
        last = offset + sum((n - 1) * s for n, s in zip(shape, strides)) + int(typestr[2:])
        if offset < 0 or last > mapping.data.size:
            raise ValueError("range buffer: a GstRangeMeta describes planes outside of the buffer")
        self.mapping = mapping
        self.__array_interface__ = {
            "data": (mapping.address + offset, True), "shape": shape, "strides": strides, "typestr": typestr, "version": 3,
        }


class View:
    """One view of a frame set: view_id; x, y (top-left pixel of the ROI in the full image); capture_time (ns); camera
    (GstRange.RangeCamera); depth (height x width, uint16, in camera.depth_unit, 0 = invalid) and colour (height x width
    x 3, uint8: R, G, B) of the ROI. The arrays are read-only and keep the buffer's memory mapped as long as they exist."""

    def __init__(self, buffer, meta, camera):
        self.view_id, self.x, self.y, self.camera = meta.view_id, meta.x, meta.y, camera
        self.capture_time = meta.capture_time
        height, width = meta.height, meta.width
        if not height or not width:
            self.depth, self.colour = np.zeros((0, 0), np.uint16), np.zeros((0, 0, 3), np.uint8)
            return
        begin = min(meta.depth_offset, meta.colour_offset)
        end = max(
            meta.depth_offset + (height - 1) * meta.depth_stride + 2 * width,
            meta.colour_offset + (height - 1) * meta.colour_stride + 4 * width,
        )
        mapping = _Mapping(buffer, begin, end - begin)
        self.depth = np.asarray(_Plane(mapping, meta.depth_offset, (height, width), (meta.depth_stride, 2), "<u2"))
        self.colour = np.asarray(
            _Plane(mapping, meta.colour_offset, (height, width, 3), (meta.colour_stride, 4, 1), "|u1")
        )


def _view_ids(caps):
    ids = GstRange.range_caps_get_view_ids(caps) if caps else 0
    if not ids:
        raise ValueError(f"expected fixed video/x-range caps with a rig, got {caps.to_string() if caps else None}")
    return [i for i in range(64) if ids >> i & 1]


def _check_raw(caps):
    if caps is not None and not isinstance(caps, Gst.Caps):
        raise TypeError(f"caps must be Gst.Caps, not {type(caps).__name__}; Gst.Caps.from_string() parses text")
    name = caps.to_string().split(",")[0] if caps and caps.get_size() else None
    if name != "video/x-range":
        raise ValueError(f"expected video/x-range, got {name}; coded frame sets need neighbourcodedec")


def map_views(frame_set, caps=None):
    """The views of a Gst.Sample, or of a Gst.Buffer with its caps, as a list of View in the order of their ids."""
    buffer = frame_set
    if isinstance(frame_set, Gst.Sample):
        buffer, caps = frame_set.get_buffer(), frame_set.get_caps()
    _check_raw(caps)
    views = []
    for view_id in _view_ids(caps):
        if meta := GstRange.buffer_get_range_meta(buffer, view_id):
            views.append(View(buffer, meta, GstRange.range_caps_get_camera(caps, view_id)[1]))
    return views


def new_camera(view_id, width, height, intrinsics, pose=None, **fields):
    """A GstRange.RangeCamera of width x height pixels. intrinsics: 3x3 matrix, or the focal length in pixels with the principal
    point at the centre of the image; pose: world_from_view, 3x4 or 4x4, metres, by default at the origin of the world
    with y up, looking along -z; other fields by name: depth_unit, near, far (metres)."""
    camera = GstRange.RangeCamera()
    focal = float(intrinsics) if np.ndim(intrinsics) == 0 else 1.0
    camera.init(view_id, width, height, focal)
    if np.ndim(intrinsics):
        camera.intrinsics = intrinsics
    if pose is not None:
        camera.pose = pose
    names = {"depth_unit": "depth_unit", "near": "min_depth", "far": "max_depth"}  # as properties of elements have them
    for name, value in fields.items():
        if name not in names:
            raise TypeError(f"new_camera: unexpected {name}; use depth_unit, near or far")
        setattr(camera, names[name], value)
    return camera


def new_caps(cameras, fps=0):
    """video/x-range caps of GstRange.RangeCameras; fps is a number of frames per second, 0 = variable or unknown.
    Raises GLib.Error if a camera's fields are out of range."""
    rate = Fraction(fps).limit_denominator(1001)
    return GstRange.range_caps_new(list(cameras), rate.numerator, rate.denominator)


def _checked(view_id, camera, view):
    name = f"view {view_id}"
    if not isinstance(view, (tuple, list)) or len(view) not in (2, 4):
        what = f"{len(view)} of them" if isinstance(view, (tuple, list)) else type(view).__name__
        raise TypeError(f"{name}: expected (depth, colour) or (depth, colour, x, y), not {what}")
    depth, colour, *corner = view
    x, y = (operator.index(n) for n in corner or (0, 0))
    for array, what, dtype in (depth, "depth", np.uint16), (colour, "colour", np.uint8):
        if not isinstance(array, np.ndarray) or array.dtype != dtype:
            raise TypeError(
                f"{name}: {what} must be an array of {np.dtype(dtype)}, not {getattr(array, 'dtype', type(array).__name__)}"
            )
    if depth.ndim != 2:
        raise ValueError(f"{name}: depth must be height x width, not {depth.shape}")
    if colour.ndim != 3 or colour.shape[2] not in (3, 4):
        raise ValueError(f"{name}: colour must be height x width x 3 or 4, not {colour.shape}")
    if colour.shape[:2] != depth.shape:
        raise ValueError(f"{name}: depth {depth.shape} and colour {colour.shape} must have the same height and width")
    if not (0 <= x <= camera.width - depth.shape[1] and 0 <= y <= camera.height - depth.shape[0]):
        raise ValueError(
            f"{name}: {depth.shape[1]}x{depth.shape[0]} pixels at ({x}, {y}) are not inside the camera's image of "
            f"{camera.width}x{camera.height}"
        )
    return depth, colour, x, y


def _write(buffer, meta, depth, colour):
    """Copies both planes into the memory of a view, once (twice without python3-gst-1.0)."""
    height, width = depth.shape
    begin, end = meta.depth_offset, meta.colour_offset + height * meta.colour_stride
    _, index, _, skip = buffer.find_memory(begin, end - begin)
    mapped = buffer.map_range(index, 1, Gst.MapFlags.WRITE)
    plain = isinstance(mapped, tuple)  # of PyGObject, whose data is a copy
    data = bytearray(end - begin + skip) if plain else mapped.data
    # Rows end in padding; the fourth byte of a pixel is 0 unless given.
    at = skip
    np.ndarray((height, width), "<u2", data, at, (meta.depth_stride, 2))[:] = depth
    at += meta.colour_offset - begin
    pixels = np.ndarray((height, width, 4), np.uint8, data, at, (meta.colour_stride, 4, 1))
    pixels[..., : colour.shape[2]] = colour
    if colour.shape[2] == 3:
        pixels[..., 3] = 0
    del pixels
    buffer.unmap(mapped[1] if plain else mapped)
    if plain:
        buffer.fill(begin - skip, bytes(data))


def new_buffer(caps, views, pts=Gst.CLOCK_TIME_NONE, duration=Gst.CLOCK_TIME_NONE, capture_time=None):
    """A frame set for appsrc or gst_pad_push(). views maps a view-id to (depth, colour) or, for an ROI, (depth, colour,
    x, y): depth is height x width, uint16, colour height x width x 3 or 4, uint8. The arrays are copied, once. Views of
    the caps that are not in it are empty. capture_time: ns on the clock of all cameras; the PTS by default."""
    _check_raw(caps)
    if not isinstance(views, dict):
        raise TypeError(f"views must be a dict of view-ids, not {type(views).__name__}")
    cameras = {i: GstRange.range_caps_get_camera(caps, i)[1] for i in _view_ids(caps)}
    if unknown := set(views) - set(cameras):
        raise ValueError(f"views {sorted(unknown, key=str)} are not in the caps, which have {sorted(cameras)}")
    if capture_time is None:
        capture_time = pts
    width, height = (max(getattr(c, side) for c in cameras.values()) for side in ("width", "height"))
    checked = {i: _checked(i, cameras[i], view) for i, view in views.items()}
    buffer = GstRange.range_buffer_new(len(cameras), width, height)
    if buffer is None:
        raise MemoryError(f"no memory for {len(cameras)} views of {width}x{height}")
    for view_id in cameras:
        depth, colour, x, y = checked.get(view_id, (None, None, 0, 0))
        w, h = (depth.shape[1], depth.shape[0]) if depth is not None and depth.size else (0, 0)
        meta = GstRange.range_buffer_add_view(buffer, view_id, x if w else 0, y if h else 0, w, h, capture_time)
        if w:
            _write(buffer, meta, depth, colour)
    buffer.pts, buffer.duration = pts, duration
    GstRange.range_buffer_set_capture_time(buffer, capture_time)
    return buffer


def _intrinsics(self):
    """3x3 matrix of focal lengths and principal point, pixels"""
    return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1]])


def _set_intrinsics(self, matrix):
    k = np.asarray(matrix, float)
    if k.shape != (3, 3) or k[0, 1] or k[1, 0] or list(k[2]) != [0, 0, 1]:
        raise ValueError("intrinsics must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
    self.fx, self.fy, self.cx, self.cy = (float(v) for v in (k[0, 0], k[1, 1], k[0, 2], k[1, 2]))


def _pose(self):
    """4x4 matrix world_from_view, metres"""
    return np.vstack([np.reshape(self.world_from_view, (3, 4)), [0, 0, 0, 1]])


def _set_pose(self, matrix):
    m = np.asarray(matrix, float)
    if m.shape not in ((3, 4), (4, 4)) or (m.shape == (4, 4) and list(m[3]) != [0, 0, 0, 1]):
        raise ValueError("pose must be the 3x4 matrix [R | t], or 4x4 with the last row [0, 0, 0, 1]")
    self.set_pose([float(v) for v in m[:3].ravel()])


GstRange.RangeCamera.intrinsics = property(_intrinsics, _set_intrinsics)
GstRange.RangeCamera.pose = property(_pose, _set_pose)
