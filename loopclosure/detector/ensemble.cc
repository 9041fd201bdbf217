#include "loopclosure/detector/ensemble.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "core/numbers.h"
#include "core/parallel.h"
#include "loopclosure/features/whole_image.h"
#include "loopclosure/geometry/verification.h"
#include "loopclosure/memory/dense_model.h"
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

namespace {

void CheckImage(const cv::Mat& image, const std::string& which) {
  if (image.empty() && image.dims <= 2) return;
  if (image.dims == 2 && (image.type() == CV_8UC1 || image.type() == CV_8UC3 || image.type() == CV_16UC1))
    return;
  throw InputError(which + "image must be CV_8UC1, CV_8UC3 (blue, green, red) or CV_16UC1, and is " +
                   cv::typeToString(image.type()));
}

// A mask and rectangles that belong to this image.
void CheckRegions(const LoopQuery& query, const std::string& which) {
  if (!query.mask.empty() &&
      (query.mask.type() != CV_8UC1 || (!query.image.empty() && query.mask.size() != query.image.size()))) {
    throw InputError(which +
                     "mask must be CV_8UC1, 0 where nothing is to be seen, and as large as the image");
  }
  if (query.cameras.empty()) return;
  if (query.camera) {
    throw InputError(which + "an image of several cameras has no common camera; leave one of the two out");
  }
  const cv::Size whole = query.image.size();
  for (std::size_t i = 0; i < query.cameras.size(); ++i) {
    const cv::Rect& region = query.cameras[i];
    const bool outside = region.x < 0 || region.y < 0 || region.width > whole.width - region.x ||
                         region.height > whole.height - region.y;
    if (region.empty() || (!query.image.empty() && outside)) {
      throw InputError(which + "cameras: a rectangle is empty or not inside of the image");
    }
    for (std::size_t j = 0; j < i; ++j) {
      if (!(region & query.cameras[j]).empty())
        throw InputError(which + "cameras: two rectangles overlap; each pixel is of one camera");
    }
  }
}

// There must be as many descriptors as keypoints, and these where pixels can be.
void CheckKeypoints(const std::vector<cv::KeyPoint>& keypoints, const cv::Mat& descriptors,
                    const std::string& which) {
  if (Index(descriptors.rows) != keypoints.size()) {
    throw InputError(which + std::to_string(keypoints.size()) + " keypoints but " +
                     std::to_string(descriptors.rows) + " descriptor rows");
  }
  const auto is_pixel = [](float value) { return std::abs(value) <= View::kFarthestPixel; };  // NaN: false
  if (!std::all_of(keypoints.begin(), keypoints.end(),
                   [&](const cv::KeyPoint& k) { return is_pixel(k.pt.x) && is_pixel(k.pt.y); })) {
    throw InputError(which + "a keypoint is not a finite number, or more than a million pixels away");
  }
}

// What a dense member has of an image: one row, or nothing.
void CheckDense(const Features& features, int width, const std::string& which) {
  if (!features.keypoints.empty()) {
    throw InputError(which + "a dense member describes the image as a whole: give no keypoints");
  }
  const std::string problem = DescriptorProblem(features.descriptors, width);
  if (!problem.empty()) throw InputError(which + problem);
}

// Features that the caller has extracted for the member of this name.
void CheckFeaturesOf(const std::string& name, const Features& features, const std::vector<Member>& members,
                     const std::string& which) {
  const auto member =
      std::find_if(members.begin(), members.end(), [&](const Member& m) { return m.name() == name; });
  if (member == members.end()) {
    throw InputError(which + "features of member '" + name + "', which is not in options.members");
  }
  if (member->dense()) {
    CheckDense(features, member->width(), which + name + ": ");
    return;
  }
  CheckKeypoints(features.keypoints, features.descriptors, which + name + ": ");
  const std::string problem = member->vocabulary().Problem(features.descriptors);
  if (!problem.empty()) throw InputError(which + name + ": " + problem);
}

void CheckMemberFeatures(const LoopQuery& query, const std::vector<Member>& members,
                         const std::string& which) {
  for (const auto& [name, features] : query.member_features) CheckFeaturesOf(name, features, members, which);
  for (const Member& member : members) {
    if (member.external() && query.member_features.count(member.name()) == 0) {
      throw InputError(which + "member '" + member.name() +
                       "' is external: give its features in member_features (none at all is fine, too)");
    }
  }
}

void CheckCallersFeatures(const FeatureSet& f, const CallersDescriptors& before, const std::string& which) {
  const std::size_t n = f.keypoints.size();
  CheckKeypoints(f.keypoints, f.descriptors, which);
  if (!f.points.empty() && f.points.size() != n) {
    throw InputError(which + std::to_string(n) + " keypoints but " + std::to_string(f.points.size()) +
                     " points; give none or one each (NaN where unknown)");
  }
  if (n == 0) return;
  if (f.descriptors.type() != CV_8U && f.descriptors.type() != CV_32F) {
    throw InputError(which + "descriptors must be CV_8U (Hamming) or CV_32F (Euclidean)");
  }
  if (before.type >= 0 && (f.descriptors.type() != before.type || f.descriptors.cols != before.width)) {
    throw InputError(which +
                     "descriptors are of another type or width than before; give every image the same kind");
  }
}

void CheckPrior(const PosePrior& prior, const std::string& which) {
  if (!prior.position_m.allFinite() || !(prior.sigma_m > 0) || !(prior.drift >= 0) ||
      !std::isfinite(prior.sigma_m) || !std::isfinite(prior.drift)) {
    throw InputError(which + "pose_prior needs a finite position, sigma_m above 0 and drift 0 or more");
  }
}

std::string Which(std::int64_t id) { return "location " + std::to_string(id) + ": "; }

}  // namespace

void CheckId(std::int64_t id, std::int64_t last_id, const std::string& file) {
  if (id < 0) throw InputError(Which(id) + "ids must not be negative");
  if (id > last_id) return;
  std::string problem = Which(id) + "ids must grow, but the one before was " + std::to_string(last_id);
  if (!file.empty()) problem += "; " + file + " has the locations of an earlier run, go on after LastId()";
  throw InputError(problem);
}

void CheckQuery(const LoopQuery& query, const std::vector<Member>& members,
                const CallersDescriptors& before) {
  const std::string which = Which(query.id);
  CheckImage(query.image, which);
  CheckCallersFeatures(query.features, before, which);
  CheckMemberFeatures(query, members, which);
  if (!query.depth_m.empty() &&
      (query.depth_m.type() != CV_32FC1 || query.depth_m.size() != query.image.size())) {
    throw InputError(which + "depth_m must be CV_32FC1 in metres and as large as the image");
  }
  CheckRegions(query, which);
  if (query.pose_prior) CheckPrior(*query.pose_prior, which);
  if (query.camera) {
    const std::string problem = query.camera->Validate();
    if (!problem.empty()) throw InputError(which + problem);
  }
}

}  // namespace tutti::internal
