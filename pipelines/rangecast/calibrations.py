# SPDX-License-Identifier: LGPL-2.1-or-later
"""Calibrations as other programs write them, found by their content; docs/formats/rig.md lists them."""

import configparser
import json
import math
import re
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from .launch import Fail, fail_unless

IDENTITY = [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0]
ONE_CAMERA = "has only one camera, and a rig needs a pair: give the files of both"
POSES = ("poses of depth cameras, as in cameraconfig.json of cwipc or calibration.txt of LiveScan3D, are not a stereo calibration: write each as "
         "world_from_view of a view into a rig file, with the intrinsics that the camera reports: docs/formats/rig.md")  # fmt: skip
NAMES = "; docs/formats/rig.md has the names that are found"
PINHOLE_MODELS = "plumb_bob radtan radial_tangential brown_conrady brown rational_polynomial rational pinhole perspective opencv none"
ZED_SIZES = {"2k": (2208, 1242), "fhd": (1920, 1080), "hd": (1280, 720), "vga": (672, 376), "fhd1200": (1920, 1200), "svga": (960, 600),
             "4k": (3840, 2160), "qhdplus": (3200, 1800)}  # fmt: skip


@dataclass
class Pose:
    """X_to = rotation X_from + translation; metres."""

    rotation: list
    translation: list

    def turn(self, point):
        return [sum(self.rotation[3 * i + j] * point[j] for j in range(3)) for i in range(3)]

    def __mul__(self, first):
        columns = [self.turn(first.rotation[i::3]) for i in range(3)]
        return Pose([columns[j][i] for i in range(3) for j in range(3)], [a + b for a, b in zip(self.turn(first.translation), self.translation)])

    def inverse(self):
        back = Pose([self.rotation[3 * j + i] for i in range(3) for j in range(3)], [0, 0, 0])
        return Pose(back.rotation, [-one for one in back.turn(self.translation)])


@dataclass
class Camera:
    size: tuple  # width, height; None: not in the file
    intrinsics: list  # fx, fy, cx, cy
    distortion: list  # as the rig has it
    pose: Pose  # camera from the world of the file
    near: float = 0.3  # metres
    far: float = 3


# ---- numbers ----


def flat(value):
    """All numbers of nested lists, of a matrix as OpenCV and ROS write it, or of text."""
    if isinstance(value, dict):
        return flat(value["data"])
    if isinstance(value, (list, tuple)):
        return [number for one in value for number in flat(one)]
    if isinstance(value, str):
        return [float(one) for one in re.split(r"[\s,;]+", value.strip("[] \t\n")) if one]
    return [float(value)]


def need(value, count, what):
    """So many finite numbers."""
    fail_unless(value is not None, f"no {what}")
    numbers = flat(value)
    fail_unless(len(numbers) == count, f"{what} needs {count} numbers, but has {len(numbers)}")
    fail_unless(all(map(math.isfinite, numbers)), f"{what} has something that is no finite number")
    return numbers


def pinhole(value, what):
    """fx, fy, cx, cy of a 3 x 3 matrix, or of the left part of a 3 x 4 one."""
    wide = len(flat(value)) // 3 if value is not None else 3
    matrix = need(value, 12 if wide == 4 else 9, what)
    fail_unless(abs(matrix[1]) < 0.01, f"{what} has a skew of {matrix[1]:g} pixels, which a rig cannot hold; undistort the images first")
    return [matrix[0], matrix[wide + 1], matrix[2], matrix[wide + 2]]


def rotation(value, what):
    """9 numbers, row by row, of a matrix or of Rodrigues' vector."""
    numbers = need(value, 3 if value is not None and len(flat(value)) == 3 else 9, what)
    if len(numbers) == 9:  # rounded ones become orthonormal by a step of Newton's method; rig-check refuses others
        turn = Pose(numbers, [0, 0, 0])
        square = turn * turn.inverse()
        near = all(abs(one - unit) < 0.002 for one, unit in zip(square.rotation, IDENTITY))
        return [1.5 * one - 0.5 * cube for one, cube in zip(numbers, (square * turn).rotation)] if near else numbers
    x, y, z = numbers
    angle = math.hypot(x, y, z) or 1
    skew = Pose([0, -z, y, z, 0, -x, -y, x, 0], [0, 0, 0])
    s, c = math.sin(angle) / angle, (1 - math.cos(angle)) / angle**2
    return [one + s * a + c * b for one, a, b in zip(IDENTITY, skew.rotation, (skew * skew).rotation)]


def metres(value, unit, what="T"):
    return [unit * one for one in need(value, 3, what)]


def lens(value, model, what):
    """Coefficients in OpenCV's order. Four may be those of another model (cv::fisheye, Kannala-Brandt), unless the file names theirs."""
    plain = re.sub(r"[- ]", "_", str(model).strip().lower()) if model is not None else None
    fail_unless(plain is None or plain in PINHOLE_MODELS.split(),
                f"the lens model '{model}' is not supported: calibrate with OpenCV's pinhole model, cv::stereoCalibrate with CALIB_RATIONAL_MODEL "
                "for wide lenses")  # fmt: skip
    fail_unless(value is not None or plain == "none", f"no {what}")
    numbers = flat(value) if plain != "none" else []
    fail_unless(model is not None or len(numbers) != 4,
                f"{what} has four coefficients, and the file does not name their model. Those of a fisheye lens (cv::fisheye, Kannala-Brandt) are not "
                "supported: calibrate with cv::stereoCalibrate and CALIB_RATIONAL_MODEL. If they are k1 k2 p1 p2 of cv::stereoCalibrate, add "
                "'distortion_model: plumb_bob' to the file")  # fmt: skip
    fail_unless(len(numbers) in (0, 4, 5, 8, 12, 14), f"{what} has {len(numbers)} coefficients, but OpenCV's model has 4, 5, 8, 12 or 14")
    return need(numbers, len(numbers), what)


# ---- files ----


def parse(path):
    """The documents of a file, as dictionaries."""
    text = Path(path).read_text("utf-8-sig", "replace")
    fail_unless("\0" not in text, UNKNOWN)
    if text.lstrip().startswith("<"):
        return [xml_value(ElementTree.fromstring(text))]
    if text.lstrip().startswith("{"):
        return [json.loads(text)]
    if re.match(r"\s*\[\w+\]\s*$", text, re.M):
        ini = configparser.ConfigParser(strict=False, interpolation=None)
        ini.read_string(text)
        return [{name.lower(): dict(ini[name]) for name in ini.sections()}]
    if re.match(r"\s*cam0=", text):  # Middlebury
        return [dict(re.findall(r"^(\w+)=(.*)$", text, re.M))]
    if re.fullmatch(r"[-+.\deE\s]+", text):  # projection matrices as those of KITTI, without their names
        lines = [line for line in text.splitlines() if line.strip()]
        counts = [len(line.split()) for line in lines]
        fail_unless(counts[:1] != [3] or set(counts) == {3}, POSES)
        if set(counts) == {12}:
            return [{f"P{i}": line for i, line in enumerate(lines[:4])}]
    try:
        import yaml  # noqa: PLC0415: other formats do without it
    except ImportError:
        raise Fail("reading YAML needs the package python3-yaml") from None

    class Loader(yaml.SafeLoader):
        """Reads what has a tag of OpenCV, NumPy or ROS, too."""

    Loader.add_multi_constructor("", lambda loader, _, node: loader.construct_mapping(node, deep=True) if isinstance(node, yaml.MappingNode)
                                 else loader.construct_sequence(node, deep=True) if isinstance(node, yaml.SequenceNode) else node.value)  # fmt: skip
    try:
        return [one for one in yaml.load_all(re.sub(r"^%YAML.*", "", text), Loader) if isinstance(one, dict)]
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        raise Fail(UNKNOWN + (f" (as YAML it is broken in line {mark.line + 1}: {error.problem})" if mark else "")) from None


def xml_value(element):
    return {child.tag: xml_value(child) for child in element} if len(element) else element.text or ""


# ---- formats: each returns {name: Camera}, or None if the files are not of it ----


def kalibr(documents, args):
    """camchain.yaml: T_cn_cnm1 takes a point from the camera before to this one; those of OpenVINS have T_imu_cam instead."""
    chain = documents[0]
    if not (isinstance(chain.get("cam0"), dict) and "intrinsics" in chain["cam0"]):
        return None
    cameras, pose = {}, Pose(IDENTITY, [0, 0, 0])
    for name in sorted((name for name in chain if re.fullmatch(r"cam\d+", name)), key=lambda name: int(name[3:])):
        cam = chain[name]
        lens([], cam.get("camera_model", "pinhole"), name)
        if "T_imu_cam" in cam:
            pose = pose_of(cam["T_imu_cam"], f"{name}: T_imu_cam").inverse()
        elif cameras:
            pose = pose_of(cam.get("T_cn_cnm1"), f"{name}: T_cn_cnm1") * pose
        model = cam.get("distortion_model", None if "distortion_coeffs" in cam else "none")
        cameras[name] = Camera(need(cam.get("resolution"), 2, "resolution"), need(cam["intrinsics"], 4, "intrinsics"),
                               lens(cam.get("distortion_coeffs"), model, f"{name}: distortion_coeffs"), pose)  # fmt: skip
    return cameras


def pose_of(value, what):
    """A 4 x 4 matrix."""
    rows = need(value, 16, what)
    return Pose(rotation([rows[4 * i + j] for i in range(3) for j in range(3)], what), rows[3:12:4])


def luxonis(documents, args):
    """Factory calibration of an OAK: the extrinsics of a camera take a point to that of toCameraSocket."""
    file = documents[0]
    if "cameraData" not in file:
        return None
    data = dict(file["cameraData"])
    pair = file.get("stereoRectificationData", {})
    sockets = [pair.get("leftCameraSocket"), pair.get("rightCameraSocket")]

    def to_root(socket, seen=()):
        fail_unless(socket in data and socket not in seen, f"the extrinsics lead to camera socket {socket}, which is not calibrated or refers back")
        way = data[socket]["extrinsics"]
        if way["toCameraSocket"] == -1:
            return socket, Pose(IDENTITY, [0, 0, 0])
        root, pose = to_root(way["toCameraSocket"], (*seen, socket))
        unit = (1, 0.01, 0.001, 0.0254, 0.3048)[way.get("lengthUnit", 1)]  # dai::LengthUnit
        return root, pose * Pose(rotation(way["rotationMatrix"], "rotationMatrix"), metres([way["translation"][axis] for axis in "xyz"], unit))

    chosen = [socket for socket in data if not set(sockets) <= set(data) or socket in sockets]
    cameras, roots = {}, set()
    for socket in sorted(chosen, key=lambda one: one != sockets[0]):
        one = data[socket]
        root, pose = to_root(socket)
        roots.add(root)
        model = {0: "perspective", 1: "fisheye"}.get(one.get("cameraType", 0), f"cameraType {one.get('cameraType')}")
        cameras[str(socket)] = Camera((one["width"], one["height"]), pinhole(one["intrinsicMatrix"], "intrinsicMatrix"),
                                      lens(one["distortionCoeff"], model, "distortionCoeff"), pose.inverse(), 1, 6)  # fmt: skip
    fail_unless(len(roots) == 1, "the extrinsics do not connect the left camera with the right one")
    return cameras


def zed(documents, args):
    """Factory calibration of a ZED, in millimetres. Sections for several sizes."""
    file = documents[0]
    modes = {ZED_SIZES[name[9:]]: name[9:] for name in file if name.startswith("left_cam_") and name[9:] in ZED_SIZES}
    if "stereo" not in file or not modes:
        return None
    size = args.size or (next(iter(modes)) if len(modes) == 1 else None)
    fail_unless(size in modes, "give the size of the images with --size: " + ", ".join("%dx%d" % one for one in sorted(modes)))
    mode = modes[size]
    stereo = file["stereo"]

    def number(name, default=None):
        value = stereo.get(f"{name}_{mode}", stereo.get(name, default))
        return need(value, 1, f"{name.upper()}_{mode.upper()} in [STEREO]")[0]

    turn = rotation([number("rx"), number("cv"), number("rz")], "rotation")
    way = [-number("baseline") / 1000, number("ty", 0) / 1000, number("tz", 0) / 1000]  # old files have neither
    cameras = {}
    for side, pose in (("left", Pose(IDENTITY, [0, 0, 0])), ("right", Pose(turn, way))):
        name = f"{side}_cam_{mode}"
        cam = file.get(name, {})
        disto = file.get(f"{side}_disto", cam)
        # A lens with k4 only beside k1 to k3 is a fisheye. Old files have k1 and k2 only, and then no others.
        fail_unless(not float(disto.get("k4", 0)) or any(float(disto.get(one, 0)) for one in ("p1", "p2", "k5", "k6")),
                    f"[{side.upper()}_DISTO] is that of a fisheye lens, which is not supported")  # fmt: skip
        names = "k1 k2 p1 p2 k3" + " k4 k5 k6" * ("k4" in disto)
        cameras[side] = Camera(size, [need(cam.get(one), 1, f"{one} in [{name.upper()}]")[0] for one in ("fx", "fy", "cx", "cy")],
                               lens([disto.get(one, 0) for one in names.split()], "opencv", name), pose)  # fmt: skip
    return cameras


def kitti(documents, args):
    """calib_cam_to_cam.txt, of the rectified images or with their --size of the raw ones; or P0 to P3 of the rectified ones."""
    file = documents[0]
    if not {"P0", "P_rect_00", "P_rect_02"} & set(file):
        return None
    cameras = {}
    for name in file:
        found = re.fullmatch(r"P(?:_rect_0)?(\d)", str(name))
        if not found:
            continue
        raw, size = (file.get(f"{kind}_0{found[1]}") for kind in ("S", "S_rect"))
        if raw is not None and args.size and list(args.size) == flat(raw):
            k, d, r, t = (f"{kind}_0{found[1]}" for kind in "KDRT")
            cameras[found[1]] = Camera(args.size, pinhole(file.get(k), k), lens(file.get(d), "opencv", d), Pose(rotation(file.get(r), r), metres(file.get(t), 1, t)))
        else:
            cameras.setdefault(found[1], projected(file[name], size and need(size, 2, "S_rect"), name))
    return cameras


def projected(value, size, name):
    """The camera of a rectified image, from its projection matrix."""
    fx, fy, cx, cy = pinhole(value, name)
    p = flat(value)
    fail_unless(len(p) == 12 and fx and fy, f"{name} needs 12 numbers with two focal lengths")
    return Camera(size, [fx, fy, cx, cy], [], Pose(IDENTITY, [(p[3] - cx * p[11]) / fx, (p[7] - cy * p[11]) / fy, p[11]]))


def panoptic(documents, args):
    """CMU Panoptic: X_camera = R X_world + t, in centimetres; the HD cameras, unless it has none or others are chosen."""
    cameras = documents[0].get("cameras")
    if not (isinstance(cameras, list) and all(isinstance(one, dict) and "distCoef" in one for one in cameras)):
        return None
    found = {}
    hd = [one for one in cameras if one.get("type") == "hd"] or cameras
    for one in [one for one in cameras if str(one["name"]) in args.pair] if args.pair else hd:
        name = str(one["name"])
        found[name] = Camera(need(one["resolution"], 2, "resolution"), pinhole(one["K"], f"{name}: K"), lens(one["distCoef"], "opencv", f"{name}: distCoef"),
                             Pose(rotation(one["R"], f"{name}: R"), metres(one["t"], 1 if args.unit else 0.01, f"{name}: t")))  # fmt: skip
    return found


def middlebury(documents, args):
    """A rectified pair, in millimetres; disparities lie between vmin and vmax, or below ndisp."""
    file = documents[0]
    if not isinstance(file.get("cam0"), str):
        return None
    need(file["cam0"], 9, "cam0")
    size = [need(file.get(name), 1, name)[0] for name in ("width", "height")]
    baseline = need(file.get("baseline"), 1, "baseline")[0] / 1000
    left, right = (Camera(size, pinhole(file.get(name), name), [], Pose(IDENTITY, [x, 0, 0])) for name, x in (("cam0", 0), ("cam1", -baseline)))
    offset = right.intrinsics[2] - left.intrinsics[2]
    depths = [left.intrinsics[0] * baseline / (need(file[name], 1, name)[0] + offset) for name in ("vmax", "ndisp", "vmin") if name in file]
    if depths:
        left.near, left.far = depths[0], depths[-1] if "vmin" in file else 10 * depths[0]
    return {"left": left, "right": right}


def ros(documents, args):
    """Two camera_info: where the cameras are follows from R and P, which are those of the rectified pair, unless a third file has R and T."""
    names = {"k": "camera_matrix", "d": "distortion_coefficients", "r": "rectification_matrix", "p": "projection_matrix", "width": "image_width",
             "height": "image_height"}  # fmt: skip
    infos = []
    for document in documents:
        info = {str(name).lower(): value for name, value in document.get("camera_info", document).items()}
        info = {name: info.get(name, info.get(long)) for name, long in names.items()} | {"model": info.get("distortion_model")}
        if info["k"] is not None and info["p"] is not None:
            infos.append(info)
    if len(infos) != 2 or len(documents) != 2:
        return None
    cameras = {}
    for name, info in zip(("left", "right"), infos):
        rectified = projected(info["p"], None, "projection_matrix").pose
        turn = Pose(rotation(info["r"], "rectification_matrix"), [0, 0, 0])
        cameras[name] = Camera([info["width"], info["height"]], pinhole(info["k"], "camera_matrix"),
                               lens(info["d"], info["model"], "distortion_coefficients"), turn.inverse() * rectified)  # fmt: skip
    moved = [one.pose.translation for one in cameras.values()]
    fail_unless(moved[0] != moved[1], "the projection matrices have no baseline: the cameras were calibrated one by one; calibrate them as a pair, or "
                "add a file with R and T of cv::stereoCalibrate")  # fmt: skip
    return cameras


TO = "(?:(?:left|(?:camera|cam)?[01])to(?:right|(?:camera|cam)?[12]))?"
KINDS = {
    "matrix": "m|k|mtx|(?:camera|cam)(?:matrix|mtx)|matrix|intrinsics?|intrinsicmatrix|cameraintrinsics?",
    "distortion": "d|dist(?:ortion)?(?:(?:coef|coeff|coefficient|param|parameter)s?)?",
    "rotation": f"(?:r|rot|rotation)(?:matrix)?{TO}",
    "translation": f"(?:t|trans|translation)(?:vector|matrix)?{TO}(?P<unit>mm|cm|m)?",
    "width": "(?:image|img|imagesize)?width",
    "height": "(?:image|img|imagesize)?height",
    "size": "(?:image|img)?(?:size|resolution)",
    "model": "(?:distortion|lens)(?:model|type)",
    "camera": "camera(?:model|type)",
}
NAME = "(?:calibration|stereo|extrinsics?|cameras?|cam)*(?P<a>left|right|[012])?(?:cameras?|cam|intrinsics?)*(?:%s)(?:camera|cam)?(?P<b>left|right|[lr012])?(?:fe)?"  # ZED's fisheye


def opencv(documents, args):
    """What cv::stereoCalibrate returns, by the names that people give it: M1, K_left, cameraMatrix2, distCoeffsL, mtx1, R, T, in one file or in
    several; those of single cameras come in the order left, right."""

    def match(kind, name):
        return re.fullmatch(NAME % KINDS[kind], re.sub(r"[^a-z0-9]", "", str(name).lower()))

    def side_of(found):
        return (found["a"] or found["b"] or "")[:1].upper()

    values, single = {}, []

    def add(document, path, side):
        for name, value in document.items():
            if isinstance(value, dict) and "data" not in value:
                add(value, path + str(name), side)
                continue
            for kind in KINDS:
                found = match(kind, path + str(name))
                # The rotation of camera_info rectifies; a number is no matrix, but a coefficient k1.
                if found and not (side and kind in ("rotation", "translation")) and not (kind == "matrix" and isinstance(value, (int, float))):
                    values.setdefault((kind, side_of(found) or side), value)
                    values.setdefault(("unit of " + kind, side_of(found) or side), found.groupdict().get("unit"))

    for document in documents:
        side = ""
        if any(match("matrix", name) and not side_of(match("matrix", name)) for name in document):
            single.append(document)
            side = "LR"[len(single) - 1 : len(single)]
        add(document, "", side)
    sides = {side for kind, side in values if kind == "matrix"}
    if not sides and ("rotation", "") not in values:
        return None
    fail_unless(len(sides) != 1, ONE_CAMERA)
    fail_unless(sides, "no M1 or K1, the camera matrices: give their file, too" + NAMES)
    fail_unless({("rotation", ""), ("translation", "")} <= set(values), "no R and T from the left to the right camera: give their file, too" + NAMES)
    cameras = {}
    for name, number, side in zip(("left", "right"), "12", next((pair for pair in ("LR", "12", "01") if set(pair) <= sides), "12")):
        matrix, distortion = (values.get((kind, side)) for kind in ("matrix", "distortion"))
        size, width, height, model, camera = (values.get((kind, side), values.get((kind, ""))) for kind in ("size", "width", "height", "model", "camera"))
        if camera is not None:
            lens([], camera, "camera model")
        intrinsics = pinhole(matrix, f"M{number} or K{number}")
        if size:  # NumPy's shape has the height first: that of which the principal point is nearer to the centre
            width, height = need(size, 2, "image size")
            size = min([width, height], [height, width], key=lambda one: math.dist(one, [2 * centre for centre in intrinsics[2:]]))
        elif width is not None and height is not None:
            size = need([width, height], 2, "image size")
        cameras[name] = Camera(size, intrinsics, lens(distortion, model, f"D{number}"), Pose(IDENTITY, [0, 0, 0]))
    unit = 1 if args.unit else {"mm": 0.001, "cm": 0.01}.get(values["unit of translation", ""], 1)
    cameras["right"].pose = Pose(rotation(values["rotation", ""], "R"), metres(values["translation", ""], unit))
    return cameras


FORMATS = [kalibr, luxonis, zed, kitti, panoptic, middlebury, ros, opencv]
UNKNOWN = ("not a calibration that import reads, which are those of OpenCV (YAML, XML, JSON), ROS, Kalibr, KITTI, Luxonis, ZED, CMU Panoptic and "
           "Middlebury: see docs/formats/rig.md")  # fmt: skip


def read_cameras(files, args):
    """{name: Camera} of the files of one calibration, in their order; the first two are left and right."""
    try:
        documents = [document for file in dict.fromkeys(files) for document in parse(file)]
    except (ElementTree.ParseError, configparser.Error, ValueError, RecursionError) as error:
        raise Fail(f"cannot be read ({str(error).splitlines()[0]})") from None
    fail_unless(documents, UNKNOWN)
    for reader in FORMATS:
        try:
            cameras = reader(documents, args)
        except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            raise Fail(f"damaged calibration of the kind {reader.__name__}: {type(error).__name__} {error}") from None
        if cameras is not None:
            fail_unless(len(documents) == 1 or reader in (ros, opencv), "one file of this kind holds all cameras: leave the others out")
            fail_unless(args.unit is None or reader not in (luxonis, zed, middlebury), "--unit: the unit of this calibration is known")
            # Where the file has no world, it is the first camera.
            world_from_first = Pose(IDENTITY, [0, 0, 0]) if reader is panoptic else next(iter(cameras.values())).pose.inverse()
            for one in cameras.values():
                one.pose = one.pose * world_from_first
                one.pose.translation = metres(one.pose.translation, args.unit or 1)
            return cameras
    raise Fail(POSES if "'trafo'" in str(documents) else UNKNOWN)
