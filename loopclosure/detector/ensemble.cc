#include "loopclosure/detector/ensemble.h"

#include <algorithm>
#include <string>
#include <utility>

#include "core/numbers.h"
#include "core/parallel.h"
#include "loopclosure/features/gradient_descriptor.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

std::vector<Member> MembersOf(const LoopDetectorOptions& options) {
  const std::string problem = options.Validate();
  if (!problem.empty()) throw InputError("loop-closure options: " + problem);
  std::vector<Member> members;
  members.reserve(options.members.size());
  for (std::size_t k = 0; k < options.members.size(); ++k) {
    members.emplace_back(options.members[k], options, options.seed * 1000003u + k);
  }
  return members;
}

// Of a dense member.
SeenWords Described(const Features& features) {
  SeenWords seen;
  seen.descriptor = NormalisedDescriptor(features.descriptors);
  return seen;
}

SeenWords Placed(std::vector<int> words, const std::vector<cv::KeyPoint>& keypoints, const cv::Size& size) {
  SeenWords seen;
  seen.words = std::move(words);
  seen.cells.reserve(seen.words.size());
  for (std::size_t i = 0; i < seen.words.size(); ++i)
    seen.cells.push_back(SeenWords::Cell(keypoints[i].pt, size));
  return seen;
}

using internal::Index;

}  // namespace

Ensemble::Ensemble(const LoopDetectorOptions& options)
    : threads_(options.threads), members_(MembersOf(options)) {}

std::vector<Features> Ensemble::Extract(const LoopQuery& query) const {
  std::vector<Features> features(members_.size());
  const bool all_given = std::all_of(members_.begin(), members_.end(), [&](const Member& m) {
    return query.member_features.count(m.name()) > 0;
  });
  const cv::Mat grey = all_given ? cv::Mat() : ToGrey8(query.image);
  RunParallel(static_cast<int>(members_.size()), threads_, [&](int k) {
    const auto given = query.member_features.find(members_[Index(k)].name());
    if (given == query.member_features.end()) {
      features[Index(k)] = members_[Index(k)].Extract(query.image, grey, query.mask);
    } else {
      // The caller owns the matrix and may write into it later: keep a copy.
      features[Index(k)] = {given->second.keypoints, given->second.descriptors.clone()};
    }
    DropMasked(query.mask, features[Index(k)]);
  });
  return features;
}

// The searches of all members are shared out among the threads in pieces; what they find does not depend on
// who searched.
std::vector<std::vector<TwoNearest>> Ensemble::SearchWords(const std::vector<Features>& features,
                                                           const std::vector<char>& usable) const {
  constexpr int kBlock = 25;
  struct Piece {
    std::size_t member;
    int begin;
  };
  std::vector<Piece> pieces;
  std::vector<std::vector<TwoNearest>> nearest(members_.size());
  for (std::size_t k = 0; k < members_.size(); ++k) {
    if (usable[k] == 0 || members_[k].dense()) continue;
    nearest[k].resize(Index(features[k].descriptors.rows));
    for (int i = 0; i < features[k].descriptors.rows; i += kBlock) pieces.push_back({k, i});
  }
  RunParallel(static_cast<int>(pieces.size()), threads_, [&](int p) {
    const auto& [k, begin] = pieces[Index(p)];
    const cv::Mat& rows = features[k].descriptors;
    members_[k].vocabulary().Search(rows, begin, std::min(rows.rows, begin + kBlock), nearest[k]);
  });
  return nearest;
}

std::vector<SeenWords> Ensemble::Quantise(const std::vector<Features>& features, const cv::Size& size) {
  std::vector<char> usable(members_.size());
  for (std::size_t k = 0; k < members_.size(); ++k) usable[k] = members_[k].Judge(features[k]) ? 1 : 0;
  const std::vector<std::vector<TwoNearest>> nearest = SearchWords(features, usable);
  std::vector<SeenWords> words(members_.size());
  RunParallel(static_cast<int>(members_.size()), threads_, [&](int i) {
    const std::size_t k = Index(i);
    if (usable[k] == 0) return;
    words[k] = members_[k].dense()
                   ? Described(features[k])
                   : Placed(members_[k].vocabulary().Assign(features[k].descriptors, nearest[k]),
                            features[k].keypoints, size);
  });
  return words;
}

std::vector<SeenWords> Ensemble::Recognise(const std::vector<Features>& features,
                                           const cv::Size& size) const {
  const std::vector<std::vector<TwoNearest>> nearest =
      SearchWords(features, std::vector<char>(members_.size(), 1));
  std::vector<SeenWords> words;
  for (std::size_t k = 0; k < members_.size(); ++k) {
    words.push_back(members_[k].dense() ? Described(features[k])
                                        : Placed(members_[k].vocabulary().Recognise(nearest[k]),
                                                 features[k].keypoints, size));
  }
  return words;
}

bool Ensemble::all_dense() const {
  return std::all_of(members_.begin(), members_.end(), [](const Member& member) { return member.dense(); });
}

}  // namespace tutti::internal
