#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Writes one calibration in each format that `rangecast import` reads and compares the rigs with what OpenCV makes of it.
The formats' layouts are those of the programs' own files; all numbers are made up."""

import contextlib
import io
import itertools
import json
import sys
from pathlib import Path

import cv2
import numpy as np
import yaml

np.set_printoptions(legacy="1.21")  # repr() of numbers as Python's, without np.float64()

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "pipelines"))
from rangecast.main import main  # noqa: E402

SIZE = (1280, 720)
K1 = np.array([[701.5, 0, 636.25], [0, 702.25, 362.5], [0, 0, 1]])
K2 = np.array([[703.0, 0, 643.75], [0, 702.5, 355.125], [0, 0, 1]])
FIVE1, FIVE2 = np.array([-0.17, 0.026, 0.0004, -0.0007, 0.001]), np.array([-0.172, 0.027, -0.0003, 0.0005, -0.0012])
ROTATION = cv2.Rodrigues(np.array([0.004, 0.012, -0.003]))[0]
T = np.array([-0.1203, 0.0007, 0.0011])
NO = np.zeros(5)
failures = 0


def run(*words):
    """In this process: a hundred times the start of Python takes half a minute."""
    sys.argv = ["rangecast", "import", *words, "--out", "rig.yaml"]
    with contextlib.redirect_stderr(io.StringIO()) as said:
        status = main()
    return status, said.getvalue()


def check(what, truth, *words):
    """The rig must project points into both images as OpenCV does with the calibration, and have its translation."""
    global failures
    status, said = run(*words)
    if status or said and "took cameras" not in said:
        failures += 1
        print(f"{what}: {said}")
        return
    view = yaml.safe_load(Path("rig.yaml").read_text().split("---")[1])["views"][0]
    pose = view["right"]["partner_from_left"]
    points = np.array([[x, y, z] for x, y, z in itertools.product((-0.5, 0, 0.6), (-0.3, 0.1, 0.35), (0.9, 1.7, 4.0))])

    def images(k1, d1, k2, d2, rotation, translation):
        return [cv2.projectPoints(points, np.zeros(3), np.zeros(3), k1, d1)[0], cv2.projectPoints(points, rotation, translation, k2, d2)[0]]

    def matrix(fx, fy, cx, cy):
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])

    found = (matrix(*view["intrinsics"]), np.array(view.get("distortion", NO)), matrix(*view["right"]["intrinsics"]),
             np.array(view["right"].get("distortion", NO)), np.array(pose["rotation"]).reshape(3, 3), np.array(pose["translation"]))  # fmt: skip
    apart = np.abs(np.array(images(*found)) - images(*truth)).max()
    moved = np.abs(found[5] - truth[5]).max()
    if apart > 0.01 or moved > 0.0001:
        failures += 1
        print(f"{what}: images differ by {apart:.3f} pixels, translations by {moved * 1000:.3f} mm")


def expect(what, found, truth):
    global failures
    if np.abs(found - truth).max() > 0.0001:
        failures += 1
        print(f"{what}: {found}, expected {truth}")


def refused(what, text, *words):
    global failures
    status, said = run(*words)
    if status != 1 or text not in said:
        failures += 1
        print(f"{what}: expected '{text}', got {status} {said}")


def storage(name, **values):
    file = cv2.FileStorage(name, cv2.FileStorage_WRITE)
    for key, value in values.items():
        file.write(key, value)
    file.release()


TRUTH = (K1, FIVE1, K2, FIVE2, ROTATION, T)


def opencv():
    for name in ("stereo.yml", "stereo.xml", "stereo.json"):
        storage(name, image_width=SIZE[0], image_height=SIZE[1], M1=K1, D1=FIVE1, M2=K2, D2=FIVE2, R=ROTATION, T=T, P1=np.eye(3, 4), R1=np.eye(3))
        check(name, TRUTH, name)
    storage("left.xml", image_size=np.array(SIZE), camera_matrix=K1, distortion_coefficients=FIVE1)
    storage("right.xml", image_size=np.array(SIZE), camera_matrix=K2, distortion_coefficients=FIVE2)
    storage("between.xml", R=cv2.Rodrigues(ROTATION)[0], T=T * 1000)
    check("three files, rotation vector, millimetres", TRUTH, "left.xml", "right.xml", "between.xml", "--unit", "0.001")
    eight = np.array([0.3, -0.1, 0.0004, -0.0007, 0.01, 0.5, -0.2, 0.02])
    storage("zero.yml", image_size=np.array(SIZE), K0=K1, D0=FIVE1, K1=K2, D1=FIVE2, R=ROTATION, T=T)
    check("counted from 0", TRUTH, "zero.yml")
    lists = {"mtxL": K1.tolist(), "distL": [eight.tolist()], "mtxR": K2.tolist(), "distR": [eight.tolist()], "R": ROTATION.tolist(), "T": T[:, None].tolist()}
    Path("lists.json").write_text(json.dumps(lists))
    Path("lists.yaml").write_text(yaml.dump(lists | {"image_size": list(SIZE)}))
    check("Python's json", (K1, eight, K2, eight, ROTATION, T), "lists.json", "--size", "1280x720")
    check("Python's yaml", (K1, eight, K2, eight, ROTATION, T), "lists.yaml")
    nested = {"left": {"camera_matrix": K1.tolist(), "dist_coeffs": FIVE1.tolist()}, "right": {"camera_matrix": K2.tolist(), "dist_coeffs": FIVE2.tolist()},
              "stereo": {"R": ROTATION.tolist(), "T": T.tolist()}, "image_size": SIZE}  # fmt: skip
    Path("nested.json").write_text(json.dumps(nested))
    check("maps of cameras", TRUTH, "nested.json")
    for name, unit in ("translation_mm", 1000), ("translationMM", 1000), ("T (mm)", 1000), ("T-cm", 100), ("T [m]", 1):
        Path("units.yaml").write_text(yaml.dump({f"{side}_camera": {"camera_matrix": k.tolist(), "distortion_params": [d.tolist()]} for side, k, d in
                                                 (("left", K1, FIVE1), ("right", K2, FIVE2))} | {"rotation_matrix_cam1_to_cam2": ROTATION.tolist(),
                                                name: (unit * T).tolist(), "image_size": list(SIZE), "k1": 0.1}))  # fmt: skip
        check(f"unit in the name {name}", TRUTH, "units.yaml")
    Path("shape.json").write_text(json.dumps(nested | {"image_size": SIZE[::-1]}))
    check("image size as NumPy's shape", TRUTH, "shape.json")
    expect("image size as NumPy's shape", np.array(yaml.safe_load(Path("rig.yaml").read_text().split("---")[1])["views"][0]["image_size"]), SIZE)
    corner = K1 - [[0, 0, 280], [0, 0, -90], [0, 0, 0]]  # nearer to the centre of 720x1280
    storage("named.yml", width=SIZE[0], height=SIZE[1], M1=corner, D1=FIVE1, M2=corner, D2=FIVE2, R=ROTATION, T=T)
    run("named.yml")
    expect("width and height by name", np.array(yaml.safe_load(Path("rig.yaml").read_text().split("---")[1])["views"][0]["image_size"]), SIZE)
    Path("swapped.json").write_text(json.dumps(nested | {"stereo": {"R": ROTATION.T.tolist(), "T": (-ROTATION.T @ T).tolist()}}))
    refused("swapped", "swapped: --pair right,left swaps them", "swapped.json")
    check("swapped back", (K2, FIVE2, K1, FIVE1, ROTATION, T), "swapped.json", "--pair", "right,left")
    refused("no size", "give --size WIDTHxHEIGHT", "lists.json")
    refused("another size", "outside of an image", "lists.json", "--size", "640x480")
    expect("a larger size", run("lists.json", "--size", "2600x1462")[1].count("far from the centre"), 2)


def models():
    four = {"K1": K1.tolist(), "D1": [[-0.02], [0.01], [0.001], [0.002]], "K2": K2.tolist(), "D2": [[-0.02], [0.01], [0.001], [0.002]],
            "R": ROTATION.tolist(), "T": T.tolist(), "image_size": SIZE}  # fmt: skip
    Path("four.json").write_text(json.dumps(four))
    refused("four coefficients", "does not name their model", "four.json")
    zed_names = json.dumps(four).replace("K1", "K_LEFT").replace("K2", "K_RIGHT").replace("D1", "D_LEFT_FE").replace("D2", "D_RIGHT_FE")
    Path("fisheye.json").write_text(zed_names)
    refused("four coefficients as ZED names them", "D1 has four coefficients", "fisheye.json")
    Path("four.json").write_text(json.dumps(four | {"D1": [0, 0, 0, 0], "D2": [0, 0, 0, 0]}))
    refused("four zeros", "does not name their model", "four.json")
    for model in ("equidistant", "fisheye", "kannala_brandt", "omnidirectional", "double_sphere", "fov"):
        Path("four.json").write_text(json.dumps(four | {"distortion_model": model}))
        refused(model, f"the lens model '{model}' is not supported", "four.json")
        Path("four.json").write_text(json.dumps(four | {"D1": FIVE1.tolist(), "D2": FIVE2.tolist(), "camera_model": model}))
        refused(model, f"the lens model '{model}' is not supported", "four.json")
    Path("four.json").write_text(json.dumps(four | {"distortion_model": "plumb_bob"}))
    coefficients = np.array([-0.02, 0.01, 0.001, 0.002])
    check("four named coefficients", (K1, coefficients, K2, coefficients, ROTATION, T), "four.json")


def kalibr():
    def cam(k, d, **more):
        return {"camera_model": "pinhole", "distortion_model": "radtan", "distortion_coeffs": d[:4].tolist(), "intrinsics": k[[0, 1, 0, 1], [0, 1, 2, 2]].tolist(),
                "resolution": list(SIZE)} | more  # fmt: skip

    step = np.eye(4)
    step[:3, :3], step[:3, 3] = ROTATION, T
    chain = {"cam0": cam(K2, FIVE2), "cam1": cam(K1, FIVE1, T_cn_cnm1=step.tolist()), "cam2": cam(K2, FIVE2, T_cn_cnm1=step.tolist())}
    Path("camchain.yaml").write_text(yaml.dump(chain))
    check("Kalibr", (K2, FIVE2[:4], K1, FIVE1[:4], ROTATION, T), "camchain.yaml")
    check("Kalibr, second pair", (K1, FIVE1[:4], K2, FIVE2[:4], ROTATION, T), "camchain.yaml", "--pair", "cam1,cam2")
    both = step @ step
    check("Kalibr, over two steps", (K2, FIVE2[:4], K2, FIVE2[:4], both[:3, :3], both[:3, 3]), "camchain.yaml", "--pair", "cam0,cam2")
    run("camchain.yaml", "--pair", "cam0,cam1")
    run("camchain.yaml", "--pair", "cam2,cam1", "--view", "1", "--append")  # swapped, so that rig.yaml must not change
    run("camchain.yaml", "--pair", "cam1,cam2", "--view", "1", "--append")
    views = [view["world_from_view"] for view in yaml.safe_load(Path("rig.yaml").read_text().split("---")[1])["views"]]
    first, second = ((np.array(pose["rotation"]).reshape(3, 3), np.array(pose["translation"])) for pose in views)
    expect("Kalibr, views of one world", first[0].T @ second[0], ROTATION.T)
    expect("Kalibr, views of one world", first[0].T @ (second[1] - first[1]), -ROTATION.T @ T)
    imu = np.eye(4)
    imu[:3, :3], imu[:3, 3] = cv2.Rodrigues(np.array([0.3, -1.2, 0.4]))[0], (0.02, -0.06, 0.01)
    imu_of = {"cam0": imu, "cam1": imu @ np.linalg.inv(step)}
    Path("openvins.yaml").write_text("%YAML:1.0\n\n" + yaml.dump({name: {key: value for key, value in chain[name].items() if key != "T_cn_cnm1"}
                                                                  | {"T_imu_cam": imu_of[name].tolist()} for name in imu_of}))  # fmt: skip
    check("OpenVINS", (K2, FIVE2[:4], K1, FIVE1[:4], ROTATION, T), "openvins.yaml")
    rounded = {"cam0": chain["cam0"], "cam1": chain["cam1"] | {"T_cn_cnm1": np.round(step, 4).tolist()}}
    Path("rounded.yaml").write_text(yaml.dump(rounded))
    check("rounded rotation", (K2, FIVE2[:4], K1, FIVE1[:4], cv2.Rodrigues(cv2.Rodrigues(np.round(ROTATION, 4))[0])[0], np.round(T, 4)), "rounded.yaml")
    refused("Kalibr, swapped", "swapped", "camchain.yaml", "--pair", "cam1,cam0")
    refused("Kalibr, no such camera", "has no camera cam7, only cam0, cam1, cam2", "camchain.yaml", "--pair", "cam0,cam7")
    for names in ({"distortion_model": "equidistant"}, {"camera_model": "omni"}, {"camera_model": "ds"}):
        Path("camchain.yaml").write_text(yaml.dump({**chain, "cam1": chain["cam1"] | names}))
        refused(f"Kalibr {names}", "is not supported", "camchain.yaml")


def ros():
    r1, r2, p1, p2 = cv2.stereoRectify(K1, FIVE1, K2, FIVE2, SIZE, ROTATION, T)[:4]

    def info(name, k, d, r, p):
        def matrix(value):
            return {"rows": len(value), "cols": value.size // len(value), "data": value.ravel().tolist()}

        return {"image_width": SIZE[0], "image_height": SIZE[1], "camera_name": name, "camera_matrix": matrix(k), "distortion_model": "plumb_bob",
                "distortion_coefficients": {"rows": 1, "cols": 5, "data": d.tolist()}, "rectification_matrix": matrix(r), "projection_matrix": matrix(p)}  # fmt: skip

    Path("left.yaml").write_text(yaml.dump(info("left", K1, FIVE1, r1, p1)))
    Path("right.yaml").write_text(yaml.dump(info("right", K2, FIVE2, r2, p2)))
    check("ROS", TRUTH, "left.yaml", "right.yaml")
    expect("ROS, warning of a wide baseline", run("left.yaml", "right.yaml", "--unit", "10")[1].count("the baseline is 1.2 m"), 1)
    refused("ROS, swapped", "swapped", "right.yaml", "left.yaml")
    refused("ROS, one camera", "only one camera", "left.yaml")
    messages = [{"header": {"frame_id": "left"}, "height": SIZE[1], "width": SIZE[0], "distortion_model": "plumb_bob", "D": d.tolist(), "K": k.ravel().tolist(),
                 "R": r.ravel().tolist(), "P": p.ravel().tolist()} for k, d, r, p in ((K1, FIVE1, r1, p1), (K2, FIVE2, r2, p2))]  # fmt: skip
    Path("topics.yaml").write_text(yaml.dump_all(messages, explicit_start=True))
    check("ROS messages", TRUTH, "topics.yaml")
    for name, k, d in (("left", K1, FIVE1), ("right", K2, FIVE2)):
        Path(f"{name}.yaml").write_text(yaml.dump(info(name, k, d, np.eye(3), np.hstack([k, np.zeros((3, 1))]))))
    refused("ROS, calibrated one by one", "no baseline", "left.yaml", "right.yaml")
    storage("between.yml", R=ROTATION, T=T)
    check("ROS with extrinsics", TRUTH, "left.yaml", "right.yaml", "between.yml")
    Path("right.yaml").write_text(yaml.dump(info("right", K2, FIVE2, r2, p2) | {"distortion_model": "equidistant"}))
    refused("ROS equidistant", "'equidistant' is not supported", "left.yaml", "right.yaml")


def kitti():
    def line(name, values):
        return f"{name}: {' '.join(f'{value:.12e}' for value in np.ravel(values))}\n"

    p = {0: np.hstack([K1, np.zeros((3, 1))]), 1: np.hstack([K1, np.array([[-701.5 * 0.5371], [0], [0]])]),
         2: np.hstack([K1, np.array([[44.85], [0.216], [0.00274]])]), 3: np.hstack([K1, np.array([[-334.1], [2.199], [0.00272]])])}  # fmt: skip
    text = "calib_time: 01-Jan-2020 13:57:47\ncorner_dist: 9.95e-02\n"
    for camera, k, d, rotation, translation in ((0, K1, FIVE1, np.eye(3), np.zeros(3)), (1, K2, FIVE2, ROTATION, T)):
        for name, values in (("S", SIZE), ("K", k), ("D", d), ("R", rotation), ("T", translation), ("S_rect", (1242, 700)), ("R_rect", np.eye(3)),
                             ("P_rect", p[camera])):  # fmt: skip
            text += line(f"{name}_0{camera}", values)
    Path("calib_cam_to_cam.txt").write_text(text + line("P1", p[3]))  # as some add
    check("KITTI, rectified", (K1, NO, K1, NO, np.eye(3), np.array([-0.5371, 0, 0])), "calib_cam_to_cam.txt")
    check("KITTI, raw", TRUTH, "calib_cam_to_cam.txt", "--size", "1280x720")
    Path("calib.txt").write_text("".join(line(f"P{camera}", values) for camera, values in p.items()) + line("Tr", np.eye(3, 4)))
    check("KITTI odometry", (K1, NO, K1, NO, np.eye(3), np.array([-0.5371, 0, 0])), "calib.txt", "--size", "1280x720")
    Path("matrices.txt").write_text("".join(line("", p[camera])[2:] for camera in (0, 1)))
    check("KITTI without names", (K1, NO, K1, NO, np.eye(3), np.array([-0.5371, 0, 0])), "matrices.txt", "--size", "1280x720")
    between = np.linalg.solve(K1, p[3][:, 3]) - np.linalg.solve(K1, p[2][:, 3])
    check("KITTI colour", (K1, NO, K1, NO, np.eye(3), between), "calib.txt", "--size", "1280x720", "--pair", "2,3")


def zed():
    def cam(k, d, scale=1):
        return "".join(f"{name}={value!r}\n" for name, value in zip(
            "fx fy cx cy k1 k2 p1 p2 k3".split(), [k[0, 0] * scale, k[1, 1] * scale, k[0, 2] * scale, k[1, 2] * scale, *d]))  # fmt: skip

    turn = cv2.Rodrigues(ROTATION)[0].ravel()
    text = "".join(f"[{side}_CAM_{mode}]\n{cam(k, d, scale)}\n" for side, k, d in (("LEFT", K1, FIVE1), ("RIGHT", K2, FIVE2))
                   for mode, scale in (("2K", 2), ("HD", 1)))  # fmt: skip
    stereo = f"[STEREO]\nBaseline={-T[0] * 1000!r}\nTY={T[1] * 1000!r}\nTZ={T[2] * 1000!r}\n" + "".join(
        f"CV_{mode}={turn[1]!r}\nRX_{mode}={turn[0]!r}\nRZ_{mode}={turn[2]!r}\n" for mode in ("2K", "HD"))
    Path("SN1.conf").write_text(text + stereo)
    check("ZED", TRUTH, "SN1.conf", "--size", "1280x720")
    refused("ZED without a size", "--size: 1280x720, 2208x1242", "SN1.conf")
    eight = (0.3, -0.1, 0.0004, -0.0007, 0.01, 0.5, -0.2, 0.02)
    disto = "".join(f"[{side}_DISTO]\n" + "".join(f"{name} = {value}\n" for name, value in zip("k1 k2 p1 p2 k3 k4 k5 k6".split(), eight)) for side in ("LEFT", "RIGHT"))
    Path("SN2.conf").write_text(text + disto + stereo)
    check("ZED, eight coefficients", (K1, np.array(eight), K2, np.array(eight), ROTATION, T), "SN2.conf", "--size", "1280x720")
    for more in ("", "k5 = 0\nk6 = 0\np1 = 0\np2 = 0\n"):
        Path("SN3.conf").write_text(text + "[LEFT_DISTO]\nk1 = 0.1\nk2 = 0.2\nk3 = 0.3\nk4 = 0.4\n" + more + stereo)
        refused("ZED fisheye", "is that of a fisheye lens", "SN3.conf", "--size", "1280x720")


def luxonis():
    fourteen = np.array([0.3, -0.1, 0.0004, -0.0007, 0.01, 0.5, -0.2, 0.02, 0, 0, 0, 0, 0, 0])

    def file(name, left, right, **more):
        def cam(k, to, rotation, translation, kind=0, unit=1):
            return {"cameraType": kind, "distortionCoeff": fourteen.tolist(), "width": SIZE[0], "height": SIZE[1], "intrinsicMatrix": k.tolist(),
                    "extrinsics": {"rotationMatrix": np.asarray(rotation).tolist(), "toCameraSocket": to, "lengthUnit": unit,
                                   "translation": dict(zip("xyz", (np.asarray(translation) * (1, 100, 1000)[unit]).tolist()))}}  # fmt: skip

        data = [[0, cam(K1, -1, np.eye(3), np.zeros(3))], [1, cam(K1, *left, **more)], [2, cam(K2, *right)]]
        Path(name).write_text(json.dumps({"cameraData": data, "stereoRectificationData": {"leftCameraSocket": 1, "rightCameraSocket": 2}}))

    root = (-1, np.eye(3), np.zeros(3))
    truth = (K1, fourteen, K2, fourteen, ROTATION, T)
    file("oak.json", (2, ROTATION, T), root)
    check("Luxonis, left to right", truth, "oak.json")
    file("oak.json", (2, ROTATION, T), root, unit=2)
    check("Luxonis, millimetres", truth, "oak.json")
    file("oak.json", root, (1, ROTATION.T, -ROTATION.T @ T))
    check("Luxonis, right to left", truth, "oak.json")
    tilt, way = cv2.Rodrigues(np.array([0.01, -0.02, 0.03]))[0], np.array([0.0375, 0.001, -0.002])
    file("oak.json", (0, tilt, way), (0, tilt @ ROTATION.T, way - tilt @ ROTATION.T @ T))
    check("Luxonis, both to the colour camera", truth, "oak.json")
    file("oak.json", (2, ROTATION, T), (1, ROTATION.T, -ROTATION.T @ T))
    refused("Luxonis, in a circle", "refers back", "oak.json")
    file("oak.json", (2, ROTATION, T), root, kind=1)
    refused("Luxonis fisheye", "'fisheye' is not supported", "oak.json")


def panoptic():
    turn, way = cv2.Rodrigues(np.array([0.3, 1.9, -0.2]))[0], np.array([0.22, 1.26, 2.83])
    cameras = [{"name": name, "type": "hd", "resolution": list(SIZE), "panel": 0, "node": i, "K": k.tolist(), "distCoef": d.tolist(), "R": r.tolist(),
                "t": [[100 * one] for one in t]} for i, (name, k, d, r, t) in enumerate(
                    (("00_00", K1, FIVE1, turn, way), ("00_01", K2, FIVE2, ROTATION @ turn, ROTATION @ way + T)))]  # fmt: skip
    Path("calibration.json").write_text(json.dumps({"calibDataSource": "x", "cameras": cameras}))
    check("CMU Panoptic", TRUTH, "calibration.json")
    view = yaml.safe_load(Path("rig.yaml").read_text().split("---")[1])["views"][0]["world_from_view"]
    expect("CMU Panoptic, position in a world with y up", np.array(view["translation"]), np.diag([1, -1, -1]) @ -turn.T @ way)
    other = [one | {"type": "rgb", "t": (np.ravel(one["t"]) / 100).tolist()} for one in cameras]
    Path("calibration.json").write_text(json.dumps({"cameras": other}))
    check("CMU Panoptic's shape, other cameras, metres", TRUTH, "calibration.json", "--unit", "1")
    vga = {**cameras[0], "name": "01_01", "type": "vga", "K": [[700, 0.4, 320], [0, 700, 240], [0, 0, 1]], "resolution": [640, 480]}
    Path("calibration.json").write_text(json.dumps({"calibDataSource": "x", "cameras": [vga, *cameras]}))
    check("CMU Panoptic, HD cameras", TRUTH, "calibration.json")
    cameras[0]["K"][0][1] = 0.4
    Path("calibration.json").write_text(json.dumps({"calibDataSource": "x", "cameras": cameras}))
    refused("CMU Panoptic with skew", "skew of 0.4 pixels", "calibration.json")


def unknown():
    for name, text in (("cameraconfig.json", json.dumps({"type": "kinect", "camera": [{"serial": "1", "trafo": np.eye(4).tolist()}]})),
                       ("Extrinsics_Open3D.log", "0\t000123\t0\n" + "0.5\t" * 16 + "\n"),
                       ("calibration.txt", "0.1 0.2 0.3 \n-0.9976720.0259786-0.0630473\n010\n001\n3\n1\n")):  # fmt: skip
        Path(name).write_text(text)
        refused(name, "poses of depth cameras", name)
    for text in ("hello\n", "\n", ""):
        Path("notes.txt").write_text(text)
        refused(f"'{text}'", "not a calibration that import reads", "notes.txt")
    Path("bent.json").write_text(json.dumps({"M1": K1.tolist(), "D1": [0] * 5, "M2": K2.tolist(), "D2": [0] * 5, "R": (ROTATION * 1.01).tolist(), "T": T.tolist()}))
    refused("no rotation", "rotation", "bent.json", "--size", "1280x720")
    Path("nan.json").write_text(json.dumps({"M1": K1.tolist(), "D1": [0, 0, 0, 0, float("nan")], "M2": K2.tolist(), "D2": [0] * 5, "R": ROTATION.tolist(), "T": T.tolist()}))
    refused("not a number", "no finite number", "nan.json", "--size", "1280x720")
    Path("broken.yaml").write_text("M1: [1, 2\nM2: }\n")
    refused("broken", "as YAML it is broken in line 2", "broken.yaml")
    Path("date.yaml").write_text("date: 2025-02-30\nM1: [1, 2]\n")
    refused("no such day", "date.yaml: cannot be read (day is out of range for month)", "date.yaml")
    Path("binary.npz").write_bytes(b"PK\3\4\0\0")
    refused("binary", "not a calibration that import reads", "binary.npz")
    Path("broken.json").write_text('{"M1": [1, 2')
    refused("broken", "broken.json: cannot be read", "broken.json")


for formats in (opencv, models, kalibr, ros, kitti, zed, luxonis, panoptic, unknown):
    formats()
sys.exit(failures > 0)
