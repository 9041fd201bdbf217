// The state of features and keyframes, for saved maps (core/state_archive.h): most of what such a map is.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "core/state_archive.h"
#include "frontend/features/features.h"
#include "frontend/store/grey_bytes.h"
#include "frontend/store/opencv_state.h"
#include "tutti/frontend/map.h"

namespace tutti {
namespace internal {

/// Numbers of which many are the same, without loss: where at most 256 differ, each takes a byte. `size`: of
/// `values`, known when they are read.
template <class Archive>
void StateOfRepeated(Archive& archive, std::size_t size, std::vector<float>* values) {
  constexpr std::size_t kMost = 256;
  std::vector<float> different;     // empty: the values follow as they are
  std::vector<std::uint8_t> which;  // empty: all are different[0]
  if constexpr (!Archive::kReading) {
    std::map<std::uint32_t, std::uint8_t> known;  // by their bits
    for (const float value : *values) {
      std::uint32_t bits = 0;
      std::memcpy(&bits, &value, sizeof bits);
      auto found = known.find(bits);
      if (found == known.end()) {
        if (different.size() == kMost) break;
        found = known.emplace(bits, static_cast<std::uint8_t>(different.size())).first;
        different.push_back(value);
      }
      which.push_back(found->second);
    }
    if (which.size() < values->size()) different.clear();
    if (different.size() < 2) which.clear();
  }
  archive(different, which);
  if (different.empty()) return archive(*values);
  if constexpr (Archive::kReading) {
    if (different.size() == 1) which.assign(size, 0);
    values->clear();
    values->reserve(which.size());
    for (const std::uint8_t w : which) {
      if (w >= different.size()) archive.Damaged("a number that is nowhere");
      values->push_back(different[w]);
    }
  }
}

/// Indices that are -1 for many: the others, and a bit that says which. `size`: as above.
template <class Archive>
void StateOfSparse(Archive& archive, std::size_t size, std::vector<int>* indices) {
  std::vector<std::uint8_t> is_there((size + 7) / 8, 0);
  std::vector<int> there;
  const auto bit = [](std::size_t i) { return static_cast<std::uint8_t>(1U << i % 8); };
  if constexpr (!Archive::kReading) {
    for (std::size_t i = 0; i < size; ++i) {
      if (i >= indices->size() || (*indices)[i] == -1) continue;
      is_there[i / 8] = static_cast<std::uint8_t>(is_there[i / 8] | bit(i));
      there.push_back((*indices)[i]);
    }
  }
  archive(is_there, there);
  if constexpr (Archive::kReading) {
    if (is_there.size() != (size + 7) / 8) archive.Damaged("indices of something else");
    indices->assign(size, -1);
    auto next = there.begin();
    for (std::size_t i = 0; i < size && next != there.end(); ++i) {
      if ((is_there[i / 8] & bit(i)) != 0) (*indices)[i] = *next++;
    }
    if (next != there.end()) archive.Damaged("more indices than places");
  }
}

/// One vector for each part of a keypoint; class_id is -1 in all.
template <class Archive>
void StateOfKeypoints(Archive& archive, std::vector<cv::KeyPoint>* keypoints) {
  std::vector<float> x, y, angle, size, response;
  std::vector<std::uint8_t> octave;
  if constexpr (!Archive::kReading) {
    for (std::vector<float>* part : {&x, &y, &angle, &size, &response}) part->reserve(keypoints->size());
    octave.reserve(keypoints->size());
    for (const cv::KeyPoint& k : *keypoints) {
      x.push_back(k.pt.x);
      y.push_back(k.pt.y);
      angle.push_back(k.angle);
      size.push_back(k.size);
      response.push_back(k.response);
      octave.push_back(static_cast<std::uint8_t>(k.octave));
    }
  }
  for (std::vector<float>* part : {&x, &y, &angle}) {
    Planes planes{part};
    archive(planes);
  }
  archive(octave);
  StateOfRepeated(archive, x.size(), &size);
  StateOfRepeated(archive, x.size(), &response);
  if constexpr (Archive::kReading) {
    for (const std::size_t other : {y.size(), angle.size(), octave.size(), size.size(), response.size()}) {
      if (other != x.size()) archive.Damaged("keypoints without all of their parts");
    }
    const auto inside = [](float v) { return std::abs(v) < 1e6F; };  // far beyond any image; not so: NaN
    keypoints->clear();
    keypoints->reserve(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (!inside(x[i]) || !inside(y[i]) || !(std::abs(angle[i]) <= 360) || !std::isfinite(size[i]) ||
          !std::isfinite(response[i]))
        archive.Damaged("a keypoint that is none");
      keypoints->emplace_back(x[i], y[i], size[i], angle[i], response[i], octave[i]);
    }
  }
}

template <class Archive>
void StateOfDepthGrid(Archive& archive, std::shared_ptr<const DepthGrid>* grid) {
  bool is_there = *grid != nullptr;
  archive(is_there);
  if (!is_there) return;
  DepthGrid state = *grid ? **grid : DepthGrid();
  archive(state.step, state.columns, state.inverse_depth);
  if constexpr (Archive::kReading) {
    const std::size_t size = state.inverse_depth.size();
    const bool whole = state.columns > 0 && size > 0 && size % static_cast<std::size_t>(state.columns) == 0;
    const bool finite = std::all_of(state.inverse_depth.begin(), state.inverse_depth.end(),
                                    [](float d) { return std::isfinite(d); });
    if (state.step < 1 || !whole || !finite) archive.Damaged("depths that are none");
    *grid = std::make_shared<const DepthGrid>(std::move(state));
  }
}

}  // namespace internal

/// The image, and the sizes of the levels that are made from it again.
template <class Archive>
void Pyramid::State(Archive& archive) {
  std::vector<std::pair<std::int32_t, std::int32_t>> sizes;
  std::string packed;
  if constexpr (!Archive::kReading) {
    const std::vector<cv::Mat>& levels = Levels();
    for (const cv::Mat& level : levels) sizes.emplace_back(level.cols, level.rows);
    if (!levels.empty()) packed = internal::PutGrey(levels[0]);
  }
  archive(sizes, packed);
  if constexpr (Archive::kReading) {
    constexpr std::size_t kMostLevels = 16;
    if (sizes.empty() || sizes.size() > kMostLevels ||
        !internal::IsGrey(packed, sizes[0].second, sizes[0].first))
      archive.Damaged("a pyramid without its image");
    for (std::size_t l = 1; l < sizes.size(); ++l) {
      const auto& [columns, rows] = sizes[l];
      if (columns < 1 || rows < 1 || columns > sizes[l - 1].first || rows > sizes[l - 1].second)
        archive.Damaged("a pyramid that grows");
    }
    make_ = [sizes = std::move(sizes), packed = std::move(packed)] {
      std::vector<cv::Mat> levels;
      levels.emplace_back(sizes[0].second, sizes[0].first, CV_8UC1);
      internal::GetGrey(packed, &levels[0]);  // it is one, as IsGrey said
      for (std::size_t l = 1; l < sizes.size(); ++l)
        levels.push_back(NextLevel(levels.back(), {sizes[l].first, sizes[l].second}));
      return levels;
    };
  }
}

template <class Archive>
void FrameFeatures::State(Archive& archive) {
  internal::StateOfKeypoints(archive, &keypoints);
  archive(descriptors);
  internal::StateOfRepeated(archive, size(), &inverse_depth);
  internal::StateOfRepeated(archive, size(), &inverse_depth_sigma);
  internal::StateOfSparse(archive, size(), &aligned);
  std::vector<float> rolled_x, rolled_y;
  if constexpr (!Archive::kReading) {
    for (const cv::Point2f& r : rolled) {
      rolled_x.push_back(r.x);
      rolled_y.push_back(r.y);
    }
  }
  archive(rolled_x, rolled_y);
  if constexpr (Archive::kReading) {
    if (rolled_x.size() != rolled_y.size() || (!rolled_x.empty() && rolled_x.size() != size()))
      archive.Damaged("rows of something else");
    rolled.clear();
    for (std::size_t f = 0; f < rolled_x.size(); ++f) {
      if (!(std::abs(rolled_x[f]) < 1e6F) || !(std::abs(rolled_y[f]) < 1e6F))
        archive.Damaged("a keypoint that is nowhere");
      rolled.emplace_back(rolled_x[f], rolled_y[f]);
    }
  }
  archive(lens, other_camera, has_depth, row_error_px, stereo_matches, columns_, rows_);
  archive(pyramid);
  internal::StateOfDepthGrid(archive, &depth_grid);
  if constexpr (Archive::kReading) {
    const bool described =
        descriptors.rows == static_cast<int>(size()) && (size() == 0 || descriptors.cols == 32);
    if (!described || inverse_depth.size() != size() || inverse_depth_sigma.size() != size())
      archive.Damaged("features without all of their parts");
    for (std::size_t f = 0; f < size(); ++f) {
      if (!(inverse_depth[f] >= 0) || !(inverse_depth_sigma[f] >= 0) || std::isinf(inverse_depth[f]) ||
          std::isinf(inverse_depth_sigma[f]))
        archive.Damaged("a depth that is none");
    }
    if (!lens.allFinite() || !std::isfinite(row_error_px)) archive.Damaged("features that are nowhere");
    constexpr int kMostCells = 65536 / kCell;
    if (columns_ != 0 || rows_ != 0) {
      archive.Check(columns_, 1, kMostCells, "an image of an impossible size");
      archive.Check(rows_, 1, kMostCells, "an image of an impossible size");
      FillGrid();
    } else if (size() != 0) {
      archive.Damaged("features without an image");
    }
  }
}

template <class Archive>
void Keyframe::State(Archive& archive) {
  archive(id, replaced_by, frame_index, stamp_s, piece, T_world_camera, features);
  if constexpr (Archive::kReading) {
    if (!features) archive.Damaged("a keyframe without features");
  }
  internal::StateOfSparse(archive, features->size(), &landmarks);
  archive(covisible);
}

}  // namespace tutti
