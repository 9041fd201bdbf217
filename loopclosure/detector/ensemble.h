// All members of a detector together: from an image to the words that each of them sees in it; and what a
// query must be, so that misuse is refused with a message before anything changes.
#pragma once

#include <cstdint>
#include <vector>

#include "loopclosure/memory/likelihood.h"
#include "loopclosure/memory/member.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::internal {

/// Steps 1 and 2 of loop-closure.md section 1, on options.threads threads; the result is the same for any
/// number of them.
class Ensemble {
 public:
  /// Throws InputError if the options are not usable.
  explicit Ensemble(const LoopDetectorOptions& options);

  /// Step 1: features of each member, the caller's where it gives them; none under the mask.
  std::vector<Features> Extract(const LoopQuery& query) const;
  /// Step 2: the words of each member, of which some are new in its vocabulary; none for a bad signature.
  /// `size`: of the image [px].
  std::vector<SeenWords> Quantise(const std::vector<Features>& features, const cv::Size& size);
  /// The words that are known already; changes nothing.
  std::vector<SeenWords> Recognise(const std::vector<Features>& features, const cv::Size& size) const;

  /// In the order of options.members; they stay where they are as long as this object.
  std::vector<Member>& members() { return members_; }
  /// In the order of options.members.
  const std::vector<Member>& members() const { return members_; }
  /// True if no member has features that geometry could use.
  bool all_dense() const;

 private:
  std::vector<std::vector<TwoNearest>> SearchWords(const std::vector<Features>& features,
                                                   const std::vector<char>& usable) const;

  int threads_;
  std::vector<Member> members_;
};

/// The caller's own descriptors, which are of one kind in all images.
struct CallersDescriptors {
  int type = -1;  ///< of cv::Mat, -1: there were none yet
  int width = 0;  ///< [values]
};

/// Throws InputError for an id that can't follow `last_id` (-1: it is the first one). `file`: the long-term
/// memory that may have it from an earlier process; empty: none.
void CheckId(std::int64_t id, std::int64_t last_id, const std::string& file = {});

/// Throws InputError for features, depth, mask, cameras or a prior that make no sense by themselves, or that
/// are not for these members; or for descriptors of another kind than those `before`.
void CheckQuery(const LoopQuery& query, const std::vector<Member>& members, const CallersDescriptors& before);

}  // namespace tutti::internal
