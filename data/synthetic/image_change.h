// Changes images as weather, light, a bad camera or traffic would: harder copies of real data, the same for
// the same seed.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace tutti {

/// One operation with its strength: 1 (mild) or 2 (strong). Immutable: Apply() may be called from several
/// threads.
///
/// | name        | what                                                     | 1            | 2            |
/// |-------------|----------------------------------------------------------|--------------|--------------|
/// | dark        | short exposure: gain and gamma, shot and read noise      | 0.5, 1.25    | 0.3, 1.6     |
/// | overexposed | gain on a veil of 12 grey levels, clipped                | about 1.7    | about 2.4    |
/// | blur        | moving camera: a line, of the image's width              | about 1.5 %  | about 3.5 %  |
/// | jpeg        | JPEG quality                                             | 15           | 8            |
/// | half        | smaller image, of its size                               | 1/2          | 1/3          |
/// | roll        | turned about its middle                                  | 15 degrees   | 30 degrees   |
/// | occluded    | covered by buses and lorries that move on with the index | 25 %         | 40 %         |
/// | rain        | streaks, and a grey veil                                 | veil of 15 % | veil of 30 % |
///
/// `roll` enlarges the image so that it stays full, but at most by 1.35; what is empty then (wide images) is
/// mirrored at the border. An odd seed turns clockwise, an even one the other way. `jpeg` and `half` do not
/// depend on the seed. Light, blur and rain differ from image to image; the occluders move.
class ImageChange {
 public:
  /// "blur:2" or "blur" (strength 1). Throws InputError that names the nearest operation.
  static ImageChange Parse(const std::string& text);
  /// All operations, in the order of the table.
  static const std::vector<std::string>& Names();

  const std::string& Name() const { return name_; }
  int Strength() const { return strength_; }

  /// The changed copy of a CV_8UC1 or CV_8UC3 image; `half` alone changes the size. `index`: which image of
  /// the sequence it is, 0 or more. Throws InputError for an empty image or another type.
  cv::Mat Apply(const cv::Mat& image, std::uint64_t seed, int index) const;

 private:
  ImageChange(std::string name, int strength) : name_(std::move(name)), strength_(strength) {}
  std::string name_;
  int strength_;
};

}  // namespace tutti
