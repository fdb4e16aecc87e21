"""Scan-to-scan odometry along a CARMEN log by small_gicp (pip install numpy small_gicp), to read beside
`skein-lab bench slam --log F --json`: python3 peer.py F"""

import json
import math
import random
import sys
import time

import numpy as np
import small_gicp

MAX_RANGE_M = 30.0
# A planar scan has no directions of surfaces in space: it is repeated at these heights.
HEIGHTS_M = (-0.3, -0.15, 0.0, 0.15, 0.3)


def read(path):
    with open(path) as log:
        for line in log:
            words = line.split()
            if words and words[0] == "FLASER":
                count = int(words[1])
                ranges = np.array(words[2 : 2 + count], dtype=float)
                step = math.pi / max(count // 90 * 90, 1)
                angles = -math.pi / 2 + step * np.arange(count)
                near = (ranges > 0.2) & (ranges < MAX_RANGE_M)
                points = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=1)[near]
                yield points, [float(word) for word in words[2 + count : 5 + count]]


def matrix(x, y, heading):
    pose = np.eye(4)
    cos, sin = math.cos(heading), math.sin(heading)
    pose[:2, :2] = [[cos, -sin], [sin, cos]]
    pose[:2, 3] = [x, y]
    return pose


def raised(points):
    return np.concatenate([np.column_stack([points, np.full(len(points), height)]) for height in HEIGHTS_M])


def main():
    scans = list(read(sys.argv[1]))
    chance = random.Random(1)
    known = [matrix(*pose) for _, pose in scans]
    told, took = [known[0]], []
    for at in range(1, len(scans)):
        moved = np.linalg.inv(known[at - 1]) @ known[at]
        way, turn = np.linalg.norm(moved[:2, 3]), abs(math.atan2(moved[1, 0], moved[0, 0]))
        place = 0.09 * way + 0.003
        off = [chance.uniform(-place, place) for _ in range(2)] + [chance.uniform(-1, 1) * (0.09 * turn + 0.002)]
        target, source = raised(scans[at - 1][0]), raised(scans[at][0])
        since = time.thread_time()
        found = small_gicp.align(
            target, source, init_T_target_source=moved @ matrix(*off), registration_type="GICP",
            downsampling_resolution=0.05, max_correspondence_distance=0.5, num_threads=1,
        )
        took.append(1e3 * (time.thread_time() - since))
        told.append(told[-1] @ found.T_target_source)
    offs, last = [], 0
    for at in range(1, len(known)):
        if np.linalg.norm((np.linalg.inv(known[last]) @ known[at])[:2, 3]) >= 1.0:
            right, said = (np.linalg.inv(poses[last]) @ poses[at] for poses in (known, told))
            error = np.linalg.inv(right) @ said
            offs.append((np.linalg.norm(error[:2, 3]), abs(math.atan2(error[1, 0], error[0, 0]))))
            last = at
    mean = np.mean(offs, axis=0)
    print(json.dumps({
        "relation_m": mean[0], "relation_rad": mean[1],
        "match_ms": {"p50": float(np.median(took)), "p99": float(np.quantile(took, 0.99))},
    }))


main()
