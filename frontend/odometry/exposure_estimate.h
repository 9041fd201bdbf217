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
  /// False: no frame has said anything.
  bool IsKnown() const { return known_; }
  /// True if nothing was said, or blur explains much of what was, but not enough yet: the next frame decides.
  bool IsOpen() const;
  /// [s]; 0 until it is known.
  double Seconds() const;

  template <class Archive>
  void State(Archive& archive) {
    archive(sum_, known_);
  }

 private:
  std::size_t Likeliest() const;

  Misfits sum_{};  // of older frames less: light changes, and the exposure with it
  bool known_ = false;
};

}  // namespace tutti
