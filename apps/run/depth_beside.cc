#include "apps/run/depth_beside.h"

#include <algorithm>
#include <cmath>

#include "frontend/dataset/image_file.h"
#include "frontend/dataset/layout.h"
#include "frontend/dataset/wrapped_dataset.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {

namespace fs = std::filesystem;

DepthBeside::DepthBeside(std::unique_ptr<Dataset> images, const std::vector<double>& stamps,
                         const fs::path& depth, const DatasetOptions& options)
    : images_(std::move(images)), options_(options), rig_(images_->Rig()), warnings_(images_->Warnings()) {
  rig_.sensor = Sensor::kRgbd;
  rig_.max_depth_m = options.max_depth_m;
  if (options.camera && options.camera->distortion != Distortion::kNone) {
    const PinholeCamera stored = TurnedCamera(rig_.camera, (360 - options.rotate) % 360);
    PinholeCamera camera = *options.camera;  // of the images' size, as OpenDataset has checked
    camera.width = stored.width;
    camera.height = stored.height;
    rectifier_.emplace(camera);
  }
  std::vector<fs::path> found;
  for (RoleImage& image : ImagesOf(depth, {""})) found.push_back(std::move(image.file));
  if (found.empty()) throw InputError(depth.string() + ": holds no depth image (--depth)");
  const bool upright = options.rotate % 180 == 0;
  const cv::Size turned(rig_.camera.width, rig_.camera.height);
  reader_.emplace(options, DepthFormat(), options.camera,
                  upright ? turned : cv::Size(turned.height, turned.width));
  for (std::string& note : reader_->Notes(found.front())) warnings_.push_back(std::move(note));
  if (found.size() == stamps.size()) {
    files_ = found;
    return;
  }
  const auto named = StampsInNames(found).stamps;
  files_.resize(stamps.size());
  std::size_t alone = stamps.size();
  for (std::size_t i = 0; i < stamps.size() && !named.empty(); ++i) {
    const auto later = std::lower_bound(named.begin(), named.end(), stamps[i],
                                        [](const auto& stamp, double s) { return stamp.first < s; });
    auto nearest = later;
    if (later == named.end() ||
        (later != named.begin() && stamps[i] - (later - 1)->first < later->first - stamps[i]))
      nearest = later - 1;
    if (std::abs(nearest->first - stamps[i]) > options.max_association_s) continue;
    files_[i] = found[nearest->second];
    --alone;
  }
  if (alone == stamps.size())
    throw InputError(depth.string() + ": has " + std::to_string(found.size()) + " depth images for " +
                     std::to_string(stamps.size()) +
                     " images, and their names are no time stamps near those of the images; give as many, or "
                     "name them by their time");
  if (alone > 0)
    warnings_.push_back(depth.string() + ": " + std::to_string(alone) + " of " +
                        std::to_string(stamps.size()) + " images have no depth image within " +
                        std::to_string(options.max_association_s) + " s");
}

ReadResult DepthBeside::Read(std::size_t i) const {
  ReadResult result = images_->Read(i);
  if (!result.frame) return result;
  const fs::path& file = files_.at(static_cast<std::size_t>(Number(i)));
  if (file.empty()) return result;
  cv::Mat metres;
  result.depth_error = reader_->Read(file, rectifier_, metres);
  if (result.depth_error.empty()) result.frame->depth_m = TurnedImage(metres, options_.rotate);
  return result;
}

}  // namespace tutti
