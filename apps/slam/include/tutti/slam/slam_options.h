// Options of the SLAM pipeline itself: how loops are searched for, trusted and brought into the map.
#pragma once

#include <string>

namespace tutti {

/// Options of SlamSystem. Each field has a key of the same name under `run:` in the YAML files.
struct SlamOptions {
  bool loops = true;           ///< search for loops and close them (--no-loops turns it off)
  int threads = 2;             ///< most threads [1..]; the result is the same for any number
  int loop_delay_frames = 10;  ///< a detection enters this many frames after its keyframe; waits if not ready
  int loop_every_keyframes = 1;       ///< every n-th keyframe is searched
  double loop_min_interval_s = 0.25;  ///< and no more often than this [s]
  double loop_min_age_s = 5.0;  ///< a candidate that is not this much older than the query is no loop [s]
  double loop_apart_fraction = 0.5;  ///< mono: cameras farther apart than this share of the median scene
                                     ///< depth see too little in common to fix a scale
  bool loop_pose_prior = true;       ///< stereo, RGB-D: the detector gets the odometry's position with each
                                     ///< keyframe (PosePrior): places out of reach lose
  int loop_confirmations = 2;  ///< verified loops that must agree before the map moves; 1 trusts each alone
  int loop_confirmation_frames = 60;  ///< and lie at most this many input frames apart, at both ends
  double loop_agree_fraction =
      0.02;                     ///< two loops agree if they close within this share of the median scene depth
  double loop_agree_deg = 1.5;  ///< and within this angle [deg]
  double loop_agree_scale = 0.10;     ///< mono: and within this |log of the scale ratio|
  double loop_after_fraction = 0.08;  ///< a loop whose residual after optimisation is beyond this share of
                                      ///< the median scene depth contradicts the graph and is taken out again
  double loop_after_deg = 3.0;        ///< the same for its angle [deg]
  double loop_defer_fraction =
      0.02;                     ///< a loop that the map fulfils within this share of the median scene depth
                                ///< enters the graph, but waits for the next correction to move the map
  double loop_defer_deg = 0.3;  ///< and within this angle [deg]; 0: each loop moves the map
  double loop_gate_sigmas = 0;  ///< a loop farther off than this Mahalanobis distance from what the map knows
                                ///< of the relative pose is refused [1]; 0: no such gate
  int inject_false_loops = 0;   ///< test of the back end: so many false loops that look verified, one with
                                ///< every third keyframe, the rest at the end
  int covisibility_min_shared = 100;  ///< landmarks that two keyframes share to get an edge in the pose graph
  int covisibility_edges = 3;         ///< at most so many of them for each keyframe, the strongest
  double odometry_sigma_deg = 0.1;    ///< standard deviation of an odometry edge's rotation [deg]
  double odometry_sigma_fraction =
      0.01;  ///< of its translation, as a share of its length (plus 0.1 % of the depth)
  double odometry_sigma_scale = 0.005;  ///< mono: of log(scale)
  double loop_sigma_deg = 0.3;          ///< least standard deviation of a loop's rotation [deg]
  double loop_sigma_fraction = 0.01;    ///< of its translation, as a share of the median scene depth
  double loop_sigma_scale = 0.02;       ///< mono: of log(scale)
  bool global_adjustment = true;        ///< after loops: what both ends see becomes one, and the whole map is
                                        ///< adjusted beside the tracking
  bool odometry_pass =
      true;  ///< after loops moved the map: track the rest again without them, for
             ///< trajectory_odometry.txt; outside of the timings. false: it ends at the first correction

  /// Empty if usable, else what is wrong.
  std::string Validate() const;
};

}  // namespace tutti
