#!/usr/bin/env python3
"""Writes small seed files for the fuzzers: make_seeds.py FOLDER makes FOLDER/loop_text and FOLDER/trajectory."""
import pathlib
import sys


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
    for name, seeds in (("loop_text", loop_text_seeds), ("trajectory", trajectory_seeds)):
        (folder / name).mkdir(parents=True, exist_ok=True)
        for seed, data in seeds():
            (folder / name / seed).write_bytes(data)


if __name__ == "__main__":
    main()
