// How long a camera exposes its images, by how much they are blurred where it moves fast.
#pragma once

#include <array>

#include "frontend/geometry/image_aligner.h"

namespace tutti {

/// Value type.
class ExposureEstimate {
 public:
  using Misfits = std::array<double, ImageAligner::kExposures>;

  /// What one frame says (ImageAligner::Misfits).
  void Add(const Misfits& misfits);
  /// False: too few frames have said something.
  bool IsKnown() const { return frames_ >= kFewest; }
  /// [s]; 0 until it is known.
  double Seconds() const;

  template <class Archive>
  void State(Archive& archive) {
    archive(sum_, frames_);
  }

 private:
  static constexpr int kFewest = 3;
  Misfits sum_{};  // of older frames less: light changes, and the exposure with it
  int frames_ = 0;
};

}  // namespace tutti
