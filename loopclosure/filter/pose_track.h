// Where the caller's odometry has been, and what that says of places. Internal.
#pragma once

#include <optional>
#include <vector>

#include "loopclosure/memory/belief.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::internal {

/// Positions of the locations by slot, as their queries gave them (PosePrior).
class PoseTrack {
 public:
  /// Largest factor of a place, and the least before they are made 1 in the mean.
  static constexpr double kMostGain = 10.0;
  static constexpr double kLogLeast = -3.0;

  /// The prior of a new location, whose slot is that of the newest; slots before it that are not known yet
  /// have none.
  void Add(int slot, const std::optional<PosePrior>& prior);

  /// The next location is not where the way of the last one led.
  void Interrupt() { last_.reset(); }

  /// Locations so far have no position any more.
  void Forget();

  /// Factor of each place (by slot) for the likelihood of the newest: max(e^-3, exp(-d^2 / (2 sigma^2))) with
  /// sigma = sigma_m + drift s, where s is the way since; over the places of working memory with a position
  /// their mean is 1, and none is above kMostGain. 1 for a place without one; empty if the newest has none,
  /// or no place has.
  std::vector<double> Gains(const std::vector<int>& working_memory) const;

  template <class Archive>
  void State(Archive& archive);

 private:
  struct Station {
    std::optional<PosePrior> prior;
    double way_m = 0;  // up to here, over all stations with a prior of the same frame in a row

    template <class Archive>
    void State(Archive& archive) {
      archive(prior, way_m);
    }
  };
  std::vector<Station> stations_;  // by slot
  double way_m_ = 0;
  std::optional<PosePrior> last_;
};

/// Brings the factors in. A place near by gains only as far as it stands out (L > 1) already: to be near says
/// nothing of what is in view. No factors: nothing changes.
void ApplyGains(const std::vector<double>& gains, const std::vector<int>& working_memory, Belief& likelihood);

}  // namespace tutti::internal
