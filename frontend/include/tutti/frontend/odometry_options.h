// Options of the visual odometry.
#pragma once

#include <cstdint>
#include <string>

namespace tutti {

/// Options of Odometry. Each field has a key of the same name under `odometry:` in the YAML files.
struct OdometryOptions {
  std::uint64_t seed = 1;  ///< of RANSAC

  /// Empty if usable, else what is wrong.
  std::string Validate() const;
};

}  // namespace tutti
