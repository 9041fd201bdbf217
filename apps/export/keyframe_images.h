// The images of a map's keyframes, in colour and free of distortion, from the data set that it was made of;
// and which of them an export takes.
#pragma once

#include <cstddef>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/export/map_model.h"
#include "tutti/frontend/dataset.h"

namespace tutti {

/// Reads them again. What is left of the lens (MapModel::lens) is taken out, so that pixels of an image are
/// those of MapModel's views.
class KeyframeImages {
 public:
  /// `dataset` must outlive this object. Throws InputError if its images come only once (a camera), have
  /// another camera than the model, or if it has none of the model's frames.
  KeyframeImages(const Dataset& dataset, const MapModel& model);

  /// CV_8UC3, blue first; with an error if the data set has no such frame, or it can't be read.
  ColourImage Read(const ModelKeyframe& keyframe) const;

 private:
  // In the data set; nothing if it has no such frame.
  std::optional<std::size_t> PlaceOf(const ModelKeyframe& keyframe) const;

  const Dataset& dataset_;
  std::int64_t offset_;                         // of its frames in the map
  std::map<std::int64_t, std::size_t> places_;  // by InputFrame::index
  cv::Mat from_x_, from_y_;                     // empty: images stay as they are
};

/// How sharp an image is: the variance of the Laplacian of its grey levels. Of use only to compare images of
/// the same place. (J. L. Pech-Pacheco et al., "Diatom autofocusing in brightfield microscopy: a comparative
/// study", ICPR 2000.)
double Sharpness(const cv::Mat& image);

/// What all images were looked at for.
struct Looks {
  std::vector<std::optional<double>> sharpness;  ///< of each keyframe; none where it has no image
  std::vector<std::string> errors;               ///< of those without
};

/// Reads the image of every keyframe once. Landmarks get their colours: the mean over their views.
Looks LookAtImages(const KeyframeImages& images, MapModel* model);

/// At most `most` of the keyframes that have a sharpness, as ascending indices. Where there are more, the one
/// that is missed least goes, again and again: whose neighbours are near (along the way of the camera, in
/// which moving and turning count alike) and which is blurred compared with those around it. First and last
/// stay unless `most` is 1.
std::vector<std::size_t> ChooseImages(const std::vector<ModelKeyframe>& keyframes,
                                      const std::vector<std::optional<double>>& sharpness, std::size_t most);

}  // namespace tutti
