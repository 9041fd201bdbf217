// Options of the SLAM pipeline itself: how loops are searched for, trusted and brought into the map.
#pragma once

#include <string>

#include "tutti/core/options.h"

#pragma GCC visibility push(default)
namespace tutti {

/// Options of SlamSystem: section `run:` of the YAML files.
struct SlamOptions {
  TUTTI_OPTION(bool, loops, true, "search for loops and close them (--no-loops turns it off)", Basic());
  TUTTI_OPTION(int, threads, 2, "most threads; the result is the same for any number", Basic(), From(1),
               To(256));
  TUTTI_OPTION(int, loop_delay_frames, 10,
               "a detection enters this many frames after its keyframe, and is waited for then",
               Unit("frames"), From(1));
  TUTTI_OPTION(int, loop_every_keyframes, 1, "every n-th keyframe is searched", From(1));
  TUTTI_OPTION(double, loop_min_interval_s, 0.25, "and no more often than this", Unit("s"), From(0));
  TUTTI_OPTION(double, loop_min_age_s, 5.0,
               "a candidate that is not this much older than the query is no loop, but where the images show "
               "surely that the local map is torn",
               Unit("s"), From(0));
  TUTTI_OPTION(bool, loop_pose_prior, true,
               "stereo, RGB-D: the detector gets the odometry's position with each keyframe (PosePrior), "
               "and places out of reach lose");
  TUTTI_OPTION(int, loop_confirmations, 2,
               "verified loops that must agree before the map moves; 1: trust each alone", Basic(), From(1));
  TUTTI_OPTION(int, loop_confirmation_frames, 60,
               "and lie at most this many input frames apart, at both ends", Unit("frames"), From(1));
  TUTTI_OPTION(double, loop_defer_fraction, 0.02,
               "a loop that the map fulfils within this share of the median scene depth enters the graph, "
               "but waits for the next correction to move the map",
               From(0));
  TUTTI_OPTION(double, loop_defer_deg, 0.3, "and within this angle; 0: each loop moves the map", Unit("deg"),
               From(0));
  TUTTI_OPTION(double, loop_gate_sigmas, 0,
               "a loop farther than this Mahalanobis distance from what the map knows of the relative pose "
               "is refused; 0: no such gate",
               From(0));
  TUTTI_OPTION(int, inject_false_loops, 0,
               "test of the back end: inject so many false loops that look verified into the graph, one with "
               "every third keyframe, the rest at the end",
               From(0));
  TUTTI_OPTION(double, odometry_sigma_deg, 0.1, "standard deviation of an odometry edge's rotation",
               Unit("deg"), Above(0));
  TUTTI_OPTION(double, odometry_sigma_fraction, 0.01,
               "of its translation, as a share of its length (plus 0.1 % of the depth)", Above(0));
  TUTTI_OPTION(bool, global_adjustment, true,
               "after loops: fusion of the landmarks of both ends, and bundle adjustment of the whole map "
               "beside the tracking",
               Basic());
  TUTTI_OPTION(
      bool, adjust_given, false,
      "`tutti close`: after loops, bundle adjustment of the whole map as in a run: the given "
      "trajectory gives way to the images. Helps one that drifts far more than they do, makes a good "
      "one worse");
  TUTTI_OPTION(bool, certify, false,
               "when loops move the map: solve the pose graph from each start (the map, the odometry, "
               "chordal), take another one than the map if it leads lower, and prove, if that is possible, "
               "that nothing better exists (`tutti optimize --certify`); summary.json has the last of them",
               Section("graph"));
  TUTTI_OPTION(
      int, prune_every, 0,
      "each time so many keyframes have come, those that the map can do without are removed, as by "
      "`tutti map prune`: a place that is driven again and again then takes no more memory; tracking "
      "waits meanwhile; not in `tutti close`; 0: never",
      From(0));
  TUTTI_OPTION(bool, odometry_pass, true,
               "after loops moved the map: beside the run, track the rest without them, too, for "
               "trajectory_odometry.txt (after a run in real time); false: it ends at the first correction",
               Basic());
  TUTTI_OPTIONS_END;

  /// Empty if usable, else what is wrong.
  std::string Validate() const { return OutOfRange(*this); }
};

}  // namespace tutti
#pragma GCC visibility pop
