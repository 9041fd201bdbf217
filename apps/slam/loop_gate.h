// Which verified loops may move the map: those that a second, independent piece of evidence agrees with.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "apps/slam/loop_solver.h"
#include "apps/slam/odometry_uncertainty.h"
#include "tutti/backend/keyframe_graph.h"
#include "tutti/core/pose.h"
#include "tutti/slam/slam_options.h"

namespace tutti {

/// A false loop ruins a map, a missed one costs little: a loop enters when it closes with another loop nearby
/// (the cycle candidate A -> query A -> query B -> candidate B -> candidate A; pairwise consistency as in
/// Mangelson et al., ICRA 2018), or when the map says the same so closely that chance is no explanation.
///
/// Images of a rolling shutter in a hand that shakes tell a motion only to a degree or two: loops that agree
/// within twice the limits need one witness more.
///
/// Loops may be weak: the detector would not have believed them. Such a loop is a witness and needs one, but
/// proves nothing by itself: a strong one must agree, and the two must have seen different things. Where a
/// place looks like another one, successive images say so alike, and agree with each other.
class LoopGate {
 public:
  /// Pose of a keyframe in the present map, and the map piece that it belongs to.
  struct Place {
    int piece = 0;
    Pose T_world_camera;
  };
  using Places = std::function<Place(int keyframe)>;
  /// Two loops agree if their cycle closes within this: 2 and 5 of a loop's least standard deviations
  /// (loop_constraint.h), which chance hardly ever does. The scale is one camera's.
  static constexpr Disagreement kAgreement{0.02, 1.5, 0.10};
  /// kWeak: the detector did not believe the loop. kFar: it did, but the map is off by so much that the
  /// odometry would have to have failed altogether; three that saw different things must say so.
  enum class Trust { kSure, kFar, kWeak };
  using Trusts = std::function<Trust(const LoopEdge& loop)>;
  /// What Admit lets in, and which loop it agrees with; none: the map says the same, or nothing was asked
  /// for.
  struct Admitted {
    std::vector<LoopEdge> loops;
    std::optional<LoopEdge> witness;
  };

  explicit LoopGate(const SlamOptions& options) : options_(options) {}

  /// Standard deviations of the odometry's motion from one keyframe to the next, for an odometry that may be
  /// a bad one: two loops agree if it can have drifted by what they differ. Without this: within
  /// kAgreement.
  void SetOdometryUncertainty(const OdometryUncertainty::Sigmas& step) { step_ = step; }

  /// The loops that may enter now: none while `loop` has to wait for another one that agrees, else it and
  /// those of `waiting` that agree with it, which come first. Loops that are in the map (`accepted`) vouch
  /// for it as well. Loops can agree whose frames are close; with `across`, also those whose keyframes stand
  /// side by side in the map, at both ends: drives at different times that are tied to each other. A loop
  /// between the same two keyframes is not another one. `trusts`: of `loop` and those that wait; empty:
  /// kSure.
  Admitted Admit(const LoopEdge& loop, const std::vector<LoopEdge>& waiting,
                 const std::vector<LoopEdge>& accepted, const Places& map, bool across = false,
                 const Trusts& trusts = {}) const;

  /// True if the images of two loops show different things, at both ends: their cameras stand apart, or look
  /// elsewhere.
  static bool Independent(const LoopEdge& a, const LoopEdge& b, const Places& map);

  /// How far the cycle of two loops and the map between their ends is from closing.
  static Disagreement Cycle(const LoopEdge& a, const LoopEdge& b, const Places& map);
  /// Distance of two keyframes in the map.
  static double Apart(int x, int y, const Places& map);

  /// True if the two loops agree with each other through the odometry between their ends, within so many
  /// times the limits.
  bool Agree(const LoopEdge& a, const LoopEdge& b, const Places& map, double times = 1) const;

  /// True if the present map fulfils the loop so well that it need not move for it.
  bool Fulfilled(const LoopEdge& loop, const Places& map) const;

  /// True if the map differs from these loops, all in all, by no more than they err themselves: the mean of
  /// their squared Mahalanobis distances [1], by their own information, is at most the number of coordinates.
  bool WithinNoise(const std::vector<LoopEdge>& loops, const Places& map) const;

 private:
  static std::optional<Similarity> InMap(const LoopEdge& loop, const Places& map);  // T_query_candidate
  std::optional<Disagreement> WithMap(const LoopEdge& loop, const Places& map) const;
  Disagreement Limits(const LoopEdge& a, const LoopEdge& b, const Places& map, double times) const;
  bool Near(const LoopEdge& a, const LoopEdge& b) const;
  static bool SideBySide(const LoopEdge& a, const LoopEdge& b, const Places& map);

  SlamOptions options_;
  OdometryUncertainty::Sigmas step_;  // not saved, as such a map is not
};

}  // namespace tutti
