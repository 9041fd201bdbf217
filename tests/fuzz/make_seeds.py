#!/usr/bin/env python3
"""Writes small seed files for the fuzzers: make_seeds.py FOLDER makes FOLDER/mat, FOLDER/loop_text, FOLDER/trajectory."""
import pathlib
import struct
import sys
import zlib

DOUBLE, UINT8, INT8, INT32, UINT32, MATRIX, COMPRESSED = 9, 2, 1, 5, 6, 14, 15
DOUBLE_CLASS, UINT8_CLASS, SPARSE_CLASS, CELL_CLASS = 6, 9, 5, 1


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)


def small_element(kind, data):
    return struct.pack("<HH", kind, len(data)) + data.ljust(4, b"\0")


def matrix(array_class, rows, columns, *content):
    flags = element(UINT32, struct.pack("<II", array_class, len(content) > 1))
    size = element(INT32, struct.pack("<ii", rows, columns))
    return element(MATRIX, flags + size + small_element(INT8, b"gt") + b"".join(content))


def compressed(variable):
    packed = zlib.compress(variable)
    return struct.pack("<II", COMPRESSED, len(packed)) + packed


def mat_seeds():
    header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    full = matrix(UINT8_CLASS, 4, 4, element(UINT8, bytes([0, 1, 0, 1] * 4)))
    doubles = matrix(DOUBLE_CLASS, 3, 3, element(DOUBLE, struct.pack("<9d", *range(9))))
    sparse = matrix(SPARSE_CLASS, 3, 3, element(INT32, struct.pack("<2i", 1, 2)),
                    element(INT32, struct.pack("<4i", 0, 2, 2, 2)), element(DOUBLE, struct.pack("<2d", 1, 1)))
    other = matrix(CELL_CLASS, 2, 2)
    yield "full", header + full
    yield "double", header + doubles
    yield "sparse", header + sparse
    yield "second_is_it", header + other + full
    yield "compressed", header + compressed(doubles)
    yield "compressed_sparse", header + compressed(sparse)


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


def main():
    folder = pathlib.Path(sys.argv[1])
    for name, seeds in (("mat", mat_seeds), ("loop_text", loop_text_seeds), ("trajectory", trajectory_seeds)):
        (folder / name).mkdir(parents=True, exist_ok=True)
        for seed, data in seeds():
            (folder / name / seed).write_bytes(data)


if __name__ == "__main__":
    main()
