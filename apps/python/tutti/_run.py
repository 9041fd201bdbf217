"""SLAM on a recording in one call: tutti.run."""
import sys

import numpy as np

from tutti._tutti import Config, Dataset, DenseMap, InputError, SlamSystem, evaluate, pose_matrices, poses_of_matrices, recognise, write_trajectory


class Run:
    """SLAM on a recording.

    Iterating gives a TrackResult for each frame, when it was tracked. All else first tracks the frames that are left and closes
    the last loops. `config`, `dataset` and `slam` (a SlamSystem) are what it is made of, `findings` what was recognised of the
    recording, a sentence each, and `frame` the frame of the last result.
    """

    def __init__(self, recording, config, findings=()):
        self.config, self.findings = config, list(findings)
        self.dataset = Dataset(recording, config)
        self.slam = SlamSystem(self.dataset.rig, config)
        self.frame = None
        self._frames, self._finished = iter(self.dataset), False

    def __iter__(self):
        return self

    def __next__(self):
        try:
            self.frame = next(self._frames)
        except StopIteration:
            if not self._finished:
                self._finished = True
                self.slam.finish()
            raise
        return self.slam.track(self.frame)

    def finish(self):
        """Tracks the frames that are left and closes the last loops. Returns self."""
        for _ in self:
            pass
        return self

    def trajectory(self):
        """Poses after loop closure, (N, 8): stamp, x, y, z, qx, qy, qz, qw of T_world_body."""
        poses, T_body_camera = self.finish().slam.trajectory(), self.dataset.rig.T_body_camera
        if np.array_equal(T_body_camera, np.eye(4)):
            return poses
        return np.column_stack([poses[:, 0], poses_of_matrices(pose_matrices(poses) @ np.linalg.inv(T_body_camera))])

    def table(self):
        """trajectory() as a pandas.DataFrame, its index the time stamps."""
        import pandas
        poses = self.trajectory()
        return pandas.DataFrame(poses[:, 1:], index=pandas.Index(poses[:, 0], name="stamp"), columns=["x", "y", "z", "qx", "qy", "qz", "qw"])

    @property
    def loops(self):
        """Every proposed loop (LoopRecord), with the reason why it was rejected."""
        return self.finish().slam.loops

    def landmarks(self):
        """The points of the map, (M, 3)."""
        return self.finish().slam.landmarks()

    def graph(self):
        """The PoseGraph of keyframes and loops."""
        return self.finish().slam.graph()

    def save(self, file):
        """Writes the map, for `tutti run --map`, `tutti localize`, `tutti export`, `tutti dense` and SlamSystem.load."""
        self.finish().slam.save(file)

    def write_trajectory(self, file, format="tum"):
        """Writes trajectory() as "tum", "kitti" or "euroc"."""
        write_trajectory(file, self.trajectory(), format)

    def evaluate(self, reference=None, **options):
        """tutti.evaluate of trajectory() against a file or array; default: the data set's own ground truth. One camera is aligned
        with scale. Raises InputError where there is none."""
        if reference is None:
            reference = self.dataset.ground_truth_file
        if reference is None:
            raise InputError("evaluate: the recording has no ground truth; give reference=FILE")
        if not isinstance(reference, np.ndarray):
            reference = self.dataset.ground_truth(reference)
        options.setdefault("alignment", "sim3" if self.dataset.rig.sensor == "mono" else "se3")
        return evaluate(reference, self.trajectory(), **options)

    def dense(self, **options):
        """A DenseMap of the depth images (RGB-D) with the corrected poses; `options` are those of DenseMap. For stereo and one
        camera, `tutti dense` makes it from the saved map."""
        rig = self.dataset.rig
        if rig.sensor != "rgbd":
            raise InputError(f"dense: a {rig.sensor} recording has no depth images; save(\"map.tutti\") and `tutti dense map.tutti` make depth of stereo")
        trajectory, surface = self.finish().slam.trajectory(), DenseMap(**options)
        stamps, poses = trajectory[:, 0], pose_matrices(trajectory)
        for i in range(len(self.dataset)):
            at = int(np.searchsorted(stamps, self.dataset.stamp(i) - 1e-6))
            if at == len(stamps) or abs(stamps[at] - self.dataset.stamp(i)) > 1e-5:
                continue  # without a pose
            frame = self.dataset[i]
            surface.integrate(frame.depth, self.dataset.colour(i), poses[at], rig.camera)
        return surface

    def plot(self, file=None):
        """Draws the trajectory from above with its accepted loops, by matplotlib. Returns the axes; with `file` also writes it."""
        import matplotlib
        if file is not None:
            matplotlib.use("Agg")
        from matplotlib import pyplot
        poses, (figure, axes) = self.trajectory(), pyplot.subplots()
        level = np.argsort(np.ptp(poses[:, 1:4], axis=0))[1:] if len(poses) else np.array([0, 2])
        x, y = sorted(int(axis) for axis in level)  # the two axes along which it moved most
        axes.plot(poses[:, 1 + x], poses[:, 1 + y], color="#1b6ca8", label="trajectory")
        for loop in self.loops:
            if loop.accepted:
                ends = [np.argmin(abs(poses[:, 0] - stamp)) for stamp in (loop.query_stamp, loop.candidate_stamp)]
                axes.plot(poses[ends, 1 + x], poses[ends, 1 + y], color="#2a8f4f", linewidth=0.8)
        unit = "map units" if self.dataset.rig.sensor == "mono" else "m"
        axes.set(xlabel=f"{'xyz'[x]} [{unit}]", ylabel=f"{'xyz'[y]} [{unit}]", aspect="equal")
        if file is not None:
            figure.savefig(file)
        return axes

    def __repr__(self):
        return f"<tutti.Run of {len(self.dataset)} frames, {self.dataset.rig.sensor}{', finished' if self._finished else ''}>"


def run(recording, config=None, *, calibration=None, camera="", fov=None, sensor=None, quiet=False, **sections):
    """SLAM on a recording: a folder of a data set or of images, a video, a bag, a stream, "camera:0".

    run("video.mp4").trajectory() is all of it. Layout, sensor and camera are recognised (see recognise) and printed on stderr
    unless `quiet`; with `config` (a Config, a YAML file, or the name of a public data set's), they come from there. Sections of
    the configuration are keywords: run("folder", run={"threads": 1}). Returns a Run, which tracks when it is asked.
    """
    if config is None:
        config, findings = recognise(recording, calibration=calibration, camera=camera, fov=fov, sensor=sensor, sections=sections)
    elif calibration or camera or fov or sensor:
        raise InputError("run: calibration, camera, fov and sensor stand in the config; leave one of the two away")
    else:
        if isinstance(config, Config) and sections:
            raise InputError("run: give the sections to Config, or the name of its file here")
        config, findings = config if isinstance(config, Config) else Config(config, **sections), []
    if not quiet:
        for finding in findings:
            print(f"  {finding}", file=sys.stderr)
    return Run(recording, config, findings)
