"""Visual SLAM and loop closure: run, LoopDetector, SlamSystem, TrajectoryCloser, PoseGraph, DenseMap, evaluate,
Dataset. tutti.run("video.mp4").trajectory() is the shortest way.

Arrays are numpy's. T_a_b maps points of frame b into frame a; the camera looks along z, x is right, y is down. Lengths
are metres (one camera: units of the map), times seconds, angles radians unless a name says _deg. Wrong input raises
tutti.InputError (a ValueError) or tutti.FileError (an OSError, too); hard images raise nothing.
"""
from tutti._tutti import *  # noqa: F401,F403
from tutti._run import Run, run  # noqa: F401
from tutti._tutti import __version__  # noqa: F401
