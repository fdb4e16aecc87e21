"""Finds markers of the original dictionary in grey images, as OpenCV does, and prints what it finds.

    find_markers.py SIDE_M FX FY CX CY K1 K2 P1 P2 K3 WIDTH HEIGHT FILE...

A line a marker: the image's number, the id, the corners (x and y of each), and how far they are from where the pose of
this marker alone has them, root of the mean square of their distances, pixels.
"""

import sys

import cv2
import numpy

side, *camera = [float(word) for word in sys.argv[1:11]]
width, height = int(sys.argv[11]), int(sys.argv[12])
fx, fy, cx, cy, *lens = camera
matrix = numpy.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
lens = numpy.array(lens)

parameters = cv2.aruco.DetectorParameters()
parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_ARUCO_ORIGINAL)
detector = cv2.aruco.ArucoDetector(dictionary, parameters)
square = numpy.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * side / 2

for number, file in enumerate(sys.argv[13:]):
    image = numpy.fromfile(file, numpy.uint8).reshape(height, width)
    corners, ids, _ = detector.detectMarkers(image)
    for marker, seen in zip([] if ids is None else ids.flatten(), corners):
        seen = seen.reshape(4, 2).astype(float)
        _, turn, shift = cv2.solvePnP(square, seen, matrix, lens, flags=cv2.SOLVEPNP_IPPE_SQUARE)
        turn, shift = cv2.solvePnPRefineLM(square, seen, matrix, lens, turn, shift)
        back, _ = cv2.projectPoints(square, turn, shift, matrix, lens)
        off = numpy.sqrt(((back.reshape(4, 2) - seen) ** 2).sum(axis=1).mean())
        print(number, marker, *seen.flatten(), off)
