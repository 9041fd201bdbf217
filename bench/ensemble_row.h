// One row of the ensemble's protocol: a rule over members, that goes through a set of images.
#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "loopclosure/detector/place_reasoner.h"
#include "tutti/loopclosure/evaluation.h"

namespace tutti::bench {

/// Names under which a member's copy stands, for "one member twice".
inline std::string BaseName(const std::string& name) { return name.substr(0, name.find('\'')); }

/// Wall time since then [ms].
inline double MillisecondsSince(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

/// What all rows see of one image.
struct Percept {
  std::vector<SeenWords> words;  ///< by member
  View view;                     ///< of all members
  double ms = 0;                 ///< that it took
};

/// Verified pairs that some row has asked for.
class PairCache {
 public:
  explicit PairCache(const VerificationOptions& options) : verifier_(options, 1) {}
  /// Adds to `ms` the time that it takes, whoever asked first.
  Verification Verify(const View& query, const View& candidate, double& ms);

 private:
  GeometricVerifier verifier_;
  std::map<std::pair<std::int64_t, std::int64_t>, std::pair<Verification, double>> done_;
};

/// "joint:surf+orb/shuffle=surf": a rule, over these members alone, with what is broken.
struct RowName {
  std::string rule, members, shuffle;
  int false_links = 0;

  /// Throws InputError.
  explicit RowName(const std::string& name);
};

/// A detector but for what rows have in common.
class Row {
 public:
  /// `members`: of the percepts; `images`: how many there will be. Throws InputError for a member that is
  /// none of these.
  Row(const std::string& name, const std::vector<std::string>& members, bool posterior_only, int images);

  /// The newest percept is that of `image`, counted from 0.
  void Take(std::int64_t image, const std::vector<Percept>& percepts, PairCache& pairs);
  nlohmann::ordered_json Figures(const LoopGroundTruth& truth) const;
  const std::string& name() const { return name_; }

 private:
  LoopResult Detect(std::int64_t image, const std::vector<Percept>& percepts, PairCache& pairs,
                    double& verify_ms, double& cached_ms);
  void PlantLinks(std::int64_t image);

  std::string name_;
  RowName parts_;
  bool posterior_only_;
  int images_;
  LoopDetectorOptions options_;
  std::vector<std::size_t> members_;
  std::vector<Member> shells_;  // names for the reasoner; the words are made elsewhere
  std::unique_ptr<internal::PlaceReasoner> reasoner_;
  std::vector<LoopObservation> observations_;
  std::vector<double> ms_;
};

/// What is printed of a row.
nlohmann::ordered_json FiguresOf(const std::vector<LoopObservation>& observations,
                                 const LoopGroundTruth& truth, double propose_threshold);

}  // namespace tutti::bench
