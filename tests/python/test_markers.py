"""Prints sheets of markers with skein-agent and reads them with other people's tools: PDFium and OpenCV.

usage: SKEIN_SIM=.../skein-sim python3 test_markers.py

Every marker is found on its sheet, in its true size. A photograph of such a sheet, made here with a lens that bends, is
shown to `skein-agent markers look` with calibrations as OpenCV and ROS write them: it finds the camera where it was.
Exit code 0 if so, 1 if not.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from harness import Failure, binary, expect

try:
    import cv2
    import numpy
    import pypdfium2
except ImportError as missing:
    print(f"skipped: needs {missing.name} (pip install opencv-python-headless pypdfium2)")
    sys.exit(0)

# Pixels of a rendered sheet for each millimetre.
SCALE = 8


def agent(*words, code=0):
    """What skein-agent prints."""
    done = subprocess.run([binary("skein-agent"), "markers", *map(str, words)], capture_output=True, text=True)
    expect(done.returncode == code, f"{words}: exit code {done.returncode}, {code} expected: {done.stderr}")
    return done.stdout if code == 0 else done.stdout + done.stderr


def found_by_opencv(image, name):
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(image)
    ids = [] if ids is None else ids.flatten().tolist()
    return dict(zip(ids, (seen.reshape(4, 2) for seen in corners)))


def sheets(folder):
    document = pypdfium2.PdfDocument(folder / "markers.pdf")
    return [page.render(scale=SCALE * 25.4 / 72).to_numpy()[:, :, :3].mean(axis=2).astype(numpy.uint8) for page in document]


def check_sheets(folder, name, floor, side_m, first, paper):
    agent("print", "--out", folder, "--dictionary", name, "--floor", floor, "--side-m", side_m, "--pitch-m", 2 * side_m,
          "--first-id", first, *(["--paper", paper] if paper else []))
    columns, rows = map(int, floor.split("x"))
    seen = {}
    for sheet in sheets(folder):
        for marker, corners in found_by_opencv(sheet, name).items():
            expect(marker not in seen, f"{name}: marker {marker} is printed twice")
            seen[marker] = corners
    expected = list(range(first, first + columns * rows))
    expect(sorted(seen) == expected, f"{name}: OpenCV finds {sorted(seen)}, {expected} were printed")
    for marker, corners in seen.items():
        upright = corners[0][1] < corners[3][1] and corners[0][0] < corners[1][0]
        expect(upright, f"{name}: marker {marker} is not upright")
        sides = [numpy.linalg.norm(corners[n] - corners[n - 1]) / SCALE for n in range(4)]
        off = max(abs(side - 1000 * side_m) for side in sides)
        expect(off < 0.2, f"{name}: marker {marker} has sides of {sides} mm")
    svg = len(list(folder.glob("markers-*.svg")))
    expect(svg == len(sheets(folder)), f"{name}: {svg} SVG files")


OPENCV = """%YAML:1.0
---
calibration_time: "Thu 01 Jan 2026 10:00:00 AM UTC"
image_width: 1280
image_height: 960
flags: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 9.0e+02, 0., 6.4e+02, 0., 9.1000000000000000e+02, 4.7e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -2.0e-01, 5.0e-02, 1.0e-03,
       -5.0e-04, 0. ]
"""
ROS = """image_width: 1280
image_height: 960
camera_name: floor
camera_matrix:
  rows: 3
  cols: 3
  data: [900.0, 0.0, 640.0, 0.0, 910.0, 470.0, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.2, 0.05, 0.001, -0.0005, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
"""


def photograph(folder, place, turn):
    """The floor of the layout as a camera sees it whose axis is turned from straight down so (a rotation vector)."""
    matrix = numpy.array([[900.0, 0, 640], [0, 910, 470], [0, 0, 1]])
    lens = numpy.array([-0.2, 0.05, 0.001, -0.0005, 0])
    # Camera to world: x east, y south, z down, then turned.
    down = numpy.diag([1.0, -1.0, -1.0])
    to_world = down @ cv2.Rodrigues(numpy.array(turn))[0]
    to_camera, shift = to_world.T, -to_world.T @ numpy.array(place)
    columns, lines = numpy.meshgrid(numpy.arange(1280.0), numpy.arange(960.0))
    pixels = numpy.stack([columns, lines], axis=-1).reshape(-1, 1, 2)
    rays = cv2.undistortPoints(pixels, matrix, lens).reshape(-1, 2)
    rays = numpy.column_stack([rays, numpy.ones(len(rays))]) @ to_world.T
    ground = numpy.array(place)[:2] - rays[:, :2] / rays[:, 2:] * place[2]
    # A floor of 4 x 3 markers of 0.12 m, 0.2 m apart: 1 px is 1 mm.
    floor = numpy.full((900, 1100), 255, numpy.uint8)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_50)
    for marker in range(12):
        x, y = 200 + 200 * (marker % 4), 700 - 200 * (marker // 4)
        floor[y - 60:y + 60, x - 60:x + 60] = cv2.aruco.generateImageMarker(dictionary, marker, 120)
    # The centre of the first is at the origin; pixels have their middles half a millimetre in.
    at = (200 + 1000 * ground[:, 0] - 0.5).astype(numpy.float32), (700 - 1000 * ground[:, 1] - 0.5).astype(numpy.float32)
    image = cv2.remap(floor, at[0].reshape(960, 1280), at[1].reshape(960, 1280), cv2.INTER_AREA, borderValue=255)
    file = folder / "photograph.png"
    cv2.imwrite(str(file), cv2.GaussianBlur(image, (3, 3), 0.8))
    return file


def check_look(folder):
    agent("print", "--out", folder, "--dictionary", "DICT_5X5_50", "--floor", "4x3", "--side-m", 0.12, "--pitch-m", 0.2)
    place = [0.31, 0.17, 1.1]
    file = photograph(folder, place, [0.1, -0.07, 0.4])
    for name, text in [("opencv.yml", OPENCV), ("ros.yaml", ROS)]:
        (folder / name).write_text(text)
        said = agent("look", file, "--layout", folder / "layout.toml", "--camera", folder / name, "--json")
        seen = json.loads(said)
        ids = sorted(marker["id"] for marker in seen["markers"])
        theirs = sorted(found_by_opencv(cv2.imread(str(file), 0), "DICT_5X5_50"))
        expect(ids == theirs and len(ids) >= 8, f"{name}: {ids} are found, {theirs} by OpenCV")
        off = numpy.linalg.norm(numpy.array(seen["camera"]["position_m"]) - place)
        expect(off < 0.005, f"{name}: the camera is found {1000 * off:.1f} mm off: {seen['camera']}")
    said = agent("look", file, "--dictionary", "DICT_5X5_50")
    expect(said.startswith(f"{len(ids)} markers of `5x5_50`"), said)
    blank = folder / "blank.png"
    cv2.imwrite(str(blank), numpy.full((480, 640), 200, numpy.uint8))
    agent("look", blank, code=1)


def check_refusals(folder):
    for words, reason in [
        (["print", "--out", folder, "--floor", "2x2", "--side-m", 0.3, "--paper", "a4"], "choose a larger one"),
        (["print", "--out", folder, "--floor", "2"], "--floor"),
        (["print", "--out", folder, "--floor", "40x40"], "1023"),
        (["print", "--out", folder, "--floor", "2x2", "--paper", "b5"], "no paper"),
        (["print", "--out", folder, "--floor", "2x2", "--dictionary", "8x8_50"], "6x6_250"),
        (["look", folder / "none.png"], "none.png"),
    ]:
        said = agent(*words, code=2)
        expect(reason in said, f"{words}: {said}")


def main():
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        check_sheets(folder / "small", "DICT_4X4_50", "5x4", 0.03, 7, "letter")
        check_sheets(folder / "original", "DICT_ARUCO_ORIGINAL", "2x2", 0.18, 100, None)
        check_sheets(folder / "large", "DICT_7X7_1000", "2x3", 0.4, 990, "600x1300")
        check_look(folder / "look")
        check_refusals(folder / "refused")
    print("markers: printed, found and measured")


if __name__ == "__main__":
    try:
        main()
    except Failure as failure:
        print(f"failed: {failure}")
        sys.exit(1)
