#!/usr/bin/env python3
"""Writes small seed files for the fuzzers of texts: make_seeds.py FOLDER makes FOLDER/<fuzzer>/<seed>."""
import pathlib
import sys

CONFIGS = pathlib.Path(__file__).parents[2] / "data" / "configs"
BAGS = pathlib.Path(__file__).parents[1] / "frontend" / "dataset" / "bags"
FILE_END = b"\x1e"  # between the files of a folder (dataset_fuzzer.cc)


def loop_text_seeds():
    yield "matrix", b"# gt\n0 0 0\n0 0 0\n1 0.5 0\n"
    yield "commas", b"0,0,255\r\n0,0,0\r\n0,0,0\r\n"
    yield "pairs", b"5 1\n6 2\n7 3\n"
    yield "bad", b"0 x\n1 0\n"


def trajectory_seeds():
    tum = b"# t\n0.5 1 2 3 0 0 0 1\n1.5 1 2 3 0 0.7 0 0.7\n1.5 0 0 0 0 0 0 1\n"
    kitti = b"1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1.5e0 0 1 0 -2 0 0 1 3\n"
    euroc = b"#timestamp [ns],p\n1403636579763555584,1,2,3,1,0,0,0\n1403636579763555585,1,2,3,0.7,0,0.7,0\n"
    for name, text in (("tum", tum), ("kitti", kitti), ("euroc", euroc), ("times", b"0.0\n1e-1\n")):
        for choice in range(6):
            yield f"{name}{choice}", bytes([choice]) + text


def g2o_seeds():
    unit = {2: "1 0 0 1 0 1", 3: " ".join("1" if i in (0, 6, 11, 15, 18, 20) else "0" for i in range(21))}
    unit[4] = " ".join("1" if i in (0, 7, 13, 18, 22, 25, 27) else "0" for i in range(28))
    se3 = "0 0 0 0 0 0 1"
    graphs = {
        "se2": "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0.1\nFIX 0\nEDGE_SE2 0 1 1 0 0.1 " + unit[2],
        "se3": f"VERTEX_SE3:QUAT 0 {se3}\nVERTEX_SE3:QUAT 1 {se3}\nEDGE_SE3:QUAT 0 1 {se3} {unit[3]}",
        "sim3": f"VERTEX_SIM3:QUAT 0 {se3} 1\nVERTEX_SIM3:QUAT 5 {se3} 2\nEDGE_SIM3:QUAT 0 5 {se3} 0.5 {unit[4]}",
        "edges": "EDGE_SE2 0 1 1 0 0.1 " + unit[2] + "\r\nEDGE_SE2 1 3 1 0 0.1 " + unit[2] + "\r\n# x\nODD 3",
        "bad": "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1,5 0 0\nEDGE_SE2 0 1 1 0 0.1 1 5 0 1 0 1",
        "toro": "VERTEX2 0 0 0 0\nEDGE2 0 1 1 0 0.1 1 0 1 1 0 0\nEDGE_SE2_SWITCHABLE 0 1 9 1 0 0 " + unit[2],
        "landmarks": "PARAMS_SE2OFFSET 1 0 0 0\nVERTEX_XY 9 1 1\nEDGE_SE2_XY 0 9 1 1 1 0 1\nEDGE_BEARING_SE2_XY 0 9 1 1\n"
                     "EDGE_SE2_OFFSET 0 1 1 1 1 0 0 " + unit[2],
        "priors": f"PARAMS_SE3OFFSET 1 {se3}\nEDGE_SE3_PRIOR 0 1 {se3} {unit[3]}\nEDGE_SE3_TRACKXYZ 0 5 1 1 2 3 1 0 0 1 0 1\n"
                  f"EDGE3 0 1 1 0 0 0 0 0 {unit[3]}",
        "indefinite": "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 1 1 0 0.1 1 5 0 1 0 1",
    }
    for name, text in graphs.items():
        for how in range(8):
            yield f"{name}{how}", bytes([how]) + text.encode() + b"\n"


def config_seeds():
    for file in sorted(CONFIGS.glob("*.yaml")):
        yield file.stem, b"\0" + file.read_bytes()
    yield "list", b"\0loops:\n  members: [orb, sift]\n  rule: mean\nrun: {threads: 2, loops: true}\n"
    yield "bad", b"\0loops:\n  membres: [orb]\n---\nrun: 1\n"
    yield "set", b"\1run.threads=2\nloops.extraction.features=300\nloops.members=[orb,surf]\ncamera.fx=5\n"


def calibration_seeds():
    texts = {
        "kalibr": "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [-0.28, 0.07, 0.0002, 1e-05]\n"
                  "  distortion_model: radtan\n  intrinsics: [458, 457, 367, 248]\n  resolution: [752, 480]\n",
        "orbslam": "%YAML:1.0\nCamera.fx: 718.8\nCamera.fy: 718.8\nCamera.cx: 607.2\nCamera.cy: 185.2\n"
                   "Camera.k1: 0.0\nCamera.bf: 386.1\nCamera.fps: 10\nDepthMapFactor: 5000\n",
        "opencv": "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
                  "   data: [ 500., 0., 320., 0., 500., 240., 0., 0., 1. ]\n",
        "ros": "image_width: 640\nimage_height: 480\ncamera_matrix: {rows: 3, cols: 3, data: "
               "[500, 0, 320, 0, 500, 240, 0, 0, 1]}\ndistortion_model: plumb_bob\n",
        "tutti": "camera: {fx: 5, fy: 5, cx: 3, cy: 2, width: 6, height: 4}\n",
        "euroc": SENSOR,
        "stella": "Camera:\n  model: fisheye\n  fx: 295\n  fy: 295\n  cx: 159\n  cy: 119\n  k1: 0.1\n  cols: 320\n  rows: 240\n",
        "vins": "%YAML:1.0\nmodel_type: KANNALA_BRANDT\nprojection_parameters: {k2: 0.1, mu: 295, mv: 295, u0: 159, v0: 119}\n",
        "basalt": '{"value0": {"T_imu_cam": [{"px": 0, "py": 0, "pz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}], "intrinsics": '
                  '[{"camera_type": "pinhole", "intrinsics": {"fx": 9, "fy": 9, "cx": 5, "cy": 5}}], "resolution": [[9, 9]]}}',
        "nerf": '{"fl_x": 262, "cx": 160, "cy": 120, "w": 320, "h": 240, "k1": 0.1, "frames": [{"fl_x": 262}]}',
        "xml": "<opencv_storage>\n<camera_matrix><data>295. 0. 159. 0. 295. 119. 0. 0. 1.</data></camera_matrix>\n"
               "<fisheye_model>1</fisheye_model></opencv_storage>\n",
        "colmap": "# Camera list\n1 OPENCV 320 240 295 295 160 120 0.1 -0.05 0.001 0\n",
        "dso": "Pinhole 0.9 1.2 0.5 0.5 0\n320 240\ncrop\n320 240\n",
        "realsense": "Width: 320\nHeight: 240\nPPX: 159\nPPY: 119\nFx: 295\nFy: 295\nDistortion: none\nCoeffs: 0 0 0 0 0\n",
        "pair": "LEFT.K: [9, 0, 5, 0, 9, 5, 0, 0, 1]\nLEFT.D: [0, 0, 0, 0]\nLEFT.R: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nRIGHT.K: "
                "[9, 0, 5, 0, 9, 5, 0, 0, 1]\nRIGHT.D: [0, 0, 0, 0]\nRIGHT.R: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nCamera.bf: 1\n"
                "Camera.fx: 9\nCamera.fy: 9\nCamera.cx: 5\nCamera.cy: 5\n",
    }
    for name, text in texts.items():
        yield name, b"\0" + text.encode()
    yield "sensor", b"\1" + SENSOR.encode()


SENSOR = """sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [0.0, -1.0, 0.0, -0.02,
         1.0, 0.0, 0.0, -0.06,
         0.0, 0.0, 1.0, 0.01,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [32, 24]
camera_model: pinhole
intrinsics: [30.0, 30.0, 16.0, 12.0] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.1, 0.01, 0.0, 0.0]
"""


def dataset_seeds():
    calib = b"P0: 30 0 16 0 0 30 12 0 0 0 1 0\nP1: 30 0 16 -3 0 30 12 0 0 0 1 0\n"
    poses = b"1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0 0 0 1 0\n"
    tum = b"0.0 0 0 0 0 0 0 1\n0.1 1 0 0 0 0 0 1\n"
    csv = b"#timestamp [ns],filename\n1,1.png\n100000001,2.png\n"
    truth = b"#timestamp,p\n1,0,0,0,1,0,0,0\n100000001,1,0,0,1,0,0,0\n"
    sensor = SENSOR.encode()
    layouts = ((calib, b"0.0\n0.1\n", poses),
               (b"# l\n0.0 rgb/1.png\n0.1 rgb/2.png\n", b"0.01 depth/1.png\n0.09 depth/2.png\n", tum),
               (csv, csv, sensor, sensor.replace(b"-0.02", b"0.09"), truth))
    for layout, files in enumerate(layouts):
        for sensor_kind in range(3):
            for count in (1, len(files)):
                yield f"{layout}_{sensor_kind}_{count}", bytes([layout, sensor_kind]) + FILE_END.join(files[:count])


def bag_seeds():
    """Of ROS 2; those of ROS 1 are make_bag_seeds.cc's. The first byte chooses sensor and topics (bag_fuzzer.cc)."""
    for file in sorted(BAGS.glob("*.mcap")) + sorted(BAGS.glob("*.db3")):
        for sensor in range(2):
            yield f"{file.stem}_{sensor}", bytes([3 + sensor]) + file.read_bytes()


def json_seeds():
    yield "summary", (b'\0{"dataset": "d", "frames": {"read": 5}, "loops": {"proposed": 3, "accepted": 2, "false": 0}, '
                      b'"seed": 1, "config": {"dataset": {"start": 2, "noise": 1.5, "noise_draw": 1}, '
                      b'"run": {"loops": true}, "loops": {"rule": "joint"}}, "evaluation": {"slam": {"ate_rmse_m": 0.5, '
                      b'"rpe_rmse_m": 0.1, "kitti_translation_percent": 1}}, "timing": {"wall_s": 3, "frame_ms": '
                      b'{"median": 20}, "stages_ms": {"odometry_track": 5}}, "memory": {"peak_mb": 100}}')
    yield "note", (b'\1{"command":"run","dataset":"/d","config":"c","ground_truth":"g","map":"m","save_map":"s",'
                   b'"checkpoint_s":5,"keep":true}')


def http_seeds():
    host = "Host: localhost\r\n"
    requests = {
        "page": f"GET / HTTP/1.1\r\n{host}\r\n",
        "events": f"GET /events HTTP/1.1\r\n{host}Accept: text/event-stream\r\n\r\n",
        "pause": f"POST /control?do=pause HTTP/1.1\r\n{host}X-Tutti: 1\r\nContent-Length: 0\r\n\r\n",
        "form": f"POST /control HTTP/1.1\r\n{host}X-Tutti: 1\r\nContent-Type: "
                "application/x-www-form-urlencoded\r\nContent-Length: 7\r\n\r\ndo=step",
        "chunked": f"POST /control HTTP/1.1\r\n{host}Transfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n0\r\n\r\n",
        "ranges": f"GET / HTTP/1.1\r\n{host}Range: bytes=0-5,7-9\r\nAccept-Encoding: gzip\r\n\r\n",
        "two": f"GET / HTTP/1.1\r\n{host}Connection: keep-alive\r\n\r\nGET /x HTTP/1.0\r\n\r\n",
        "upgrade": f"PRI * HTTP/2.0\r\n{host}Expect: 100-continue\r\n\r\n",
    }
    for name, text in requests.items():
        yield name, text.encode()


def main():
    folder = pathlib.Path(sys.argv[1])
    for name, seeds in (("loop_text", loop_text_seeds), ("trajectory", trajectory_seeds), ("g2o", g2o_seeds),
                        ("config", config_seeds), ("calibration", calibration_seeds), ("dataset", dataset_seeds),
                        ("bag", bag_seeds), ("json", json_seeds), ("http", http_seeds)):
        (folder / name).mkdir(parents=True, exist_ok=True)
        for seed, data in seeds():
            (folder / name / seed).write_bytes(data)


if __name__ == "__main__":
    main()
