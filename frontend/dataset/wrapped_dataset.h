// Data sets made of another one: a part of its frames, with noise if wanted; or images that are turned, of a
// camera that was not upright.
#pragma once

#include <memory>
#include <string>

#include "tutti/frontend/dataset.h"

#pragma GCC visibility push(default)  // of the commands, too
namespace tutti {

/// The image turned clockwise by 0, 90, 180 or 270 degrees; an empty one stays empty.
cv::Mat TurnedImage(const cv::Mat& image, int degrees);

/// The camera whose images are those of `camera`, turned clockwise, with its distortion.
PinholeCamera TurnedCamera(const PinholeCamera& camera, int degrees);

/// The data set with images, masks and depth images turned clockwise by 90, 180 or 270 degrees. The rig's
/// camera is turned with them, and T_body_camera the other way, so that the body's poses stay what they are
/// and the ground truth still fits. Throws InputError for stereo (a turned pair does not lie side by side)
/// and for a rolling shutter (the rows would no longer be read one after the other); `name` is what the
/// message calls the data set.
std::unique_ptr<Dataset> TurnFrames(std::unique_ptr<Dataset> stored, int degrees, const std::string& name);

/// The frames options.start, start + stride, ... before options.end of `whole`, which keep their stamps and
/// their numbers (InputFrame::index), with options.noise. `whole` itself if that is all it has. Throws
/// InputError for an end that is not after the start, and if all of a stored data set's frames are left out.
std::unique_ptr<Dataset> SelectFrames(std::unique_ptr<Dataset> whole, const DatasetOptions& options,
                                      const std::string& name);

}  // namespace tutti
#pragma GCC visibility pop
