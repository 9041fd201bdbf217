// Which verified loops may move the map: those that a second, independent piece of evidence agrees with.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "tutti/slam/loop_record.h"
#include "tutti/slam/slam_options.h"

namespace tutti {

/// How far two transforms disagree: E maps a keyframe's camera onto itself and should be the identity.
struct Disagreement {
  double fraction = 0;   ///< translation as a share of the median scene depth
  double angle_deg = 0;  ///< rotation [deg]
  double log_scale = 0;  ///< |log(scale)|
};
Disagreement Measure(const Similarity& E, double depth);
/// Too much for a loop that belongs to an optimised map (loop_after_fraction, loop_after_deg).
bool Contradicts(const Disagreement& d, const SlamOptions& options);

/// A false loop ruins a map, a missed one costs little: a loop enters when it closes with another loop nearby
/// (the cycle candidate A -> query A -> query B -> candidate B -> candidate A; pairwise consistency as in
/// Mangelson et al., ICRA 2018), or when the map says the same so closely that chance is no explanation.
class LoopGate {
 public:
  /// Pose of a keyframe in the present map, and the map piece that it belongs to.
  struct Place {
    int piece = 0;
    Pose T_world_camera;
  };
  using Map = std::function<Place(int keyframe)>;

  explicit LoopGate(const SlamOptions& options) : options_(options) {}

  /// The loops that may enter now: none while `loop` waits for another one that agrees, else it and those
  /// that waited.
  std::vector<LoopEdge> Offer(const LoopEdge& loop, const Map& map);

  /// True if the two loops agree with each other through the odometry between their ends.
  bool Agree(const LoopEdge& a, const LoopEdge& b, const Map& map) const;

  /// True if the present map fulfils the loop so well that it need not move for it.
  bool Fulfilled(const LoopEdge& loop, const Map& map) const;

  /// To be told of what finally entered, and (mono) of the map's change of scale: waiting loops are measured
  /// again.
  void Accepted(const LoopEdge& loop) { accepted_.push_back(loop); }
  const std::vector<LoopEdge>& waiting() const { return waiting_; }
  /// The loops that entered; the pose graph rescales them when it moves the map.
  std::vector<LoopEdge>& accepted() { return accepted_; }
  const std::vector<LoopEdge>& accepted() const { return accepted_; }
  std::vector<LoopEdge>& waiting() { return waiting_; }

 private:
  std::optional<Disagreement> WithMap(const LoopEdge& loop, const Map& map) const;
  bool Within(const Disagreement& d) const;
  bool Near(const LoopEdge& a, const LoopEdge& b) const;

  SlamOptions options_;
  std::vector<LoopEdge> waiting_, accepted_;
};

}  // namespace tutti
