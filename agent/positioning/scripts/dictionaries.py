"""Writes the bit tables of the marker dictionaries from OpenCV's (opencv-python-headless, Apache-2.0).

    python3 -m pip install opencv-python-headless
    python3 agent/positioning/scripts/dictionaries.py

One file a family, one marker a line, from id 0: its data bits row by row as a hexadecimal number, the first bit the
highest; white is 1. The smaller dictionaries of a family are the beginnings of its largest. `limits.txt` holds how
many wrong bits each dictionary corrects. The original dictionary has a rule, so its table serves its test alone.
"""

import pathlib

from cv2 import aruco

FOLDER = pathlib.Path(__file__).parent.parent / "src" / "markers" / "dictionaries"
LICENCE = "# From OpenCV {}, Apache-2.0, by scripts/dictionaries.py.\n"


def codes(dictionary):
    side = dictionary.markerSize
    for id in range(len(dictionary.bytesList)):
        bits = aruco.Dictionary.getBitsFromByteList(dictionary.bytesList[id : id + 1], side)
        yield int("".join(str(bit) for bit in bits.flatten()), 2)


def main():
    import cv2

    licence = LICENCE.format(cv2.__version__)
    original = aruco.getPredefinedDictionary(aruco.DICT_ARUCO_ORIGINAL)
    tables = {"original": list(codes(original))}
    limits = [("original", original.maxCorrectionBits)]
    for side in range(4, 8):
        family = f"{side}x{side}"
        for count in (50, 100, 250, 1000):
            name = f"{family}_{count}"
            dictionary = aruco.getPredefinedDictionary(getattr(aruco, f"DICT_{name.upper()}"))
            table = list(codes(dictionary))
            assert tables.setdefault(family, table)[: min(50, count)] == table[:50]
            if len(table) > len(tables[family]):
                assert table[: len(tables[family])] == tables[family]
                tables[family] = table
            limits.append((name, dictionary.maxCorrectionBits))
    for family, table in tables.items():
        (FOLDER / f"{family}.txt").write_text(licence + "".join(f"{code:x}\n" for code in table))
    (FOLDER / "limits.txt").write_text(licence + "".join(f"{name} {limit}\n" for name, limit in limits))


if __name__ == "__main__":
    main()
