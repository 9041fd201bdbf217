// Input of `tutti loops` (and of `tutti generate --from-images`): the images of a folder and the ground truth
// that fits them.
#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tutti/core/camera.h"
#include "tutti/core/trajectory.h"
#include "tutti/loopclosure/ground_truth.h"

namespace tutti {
class Dataset;
}

namespace tutti::cli {

/// The images of a folder that are frames, as `tutti run` takes them (FramesIn: no pictures of another type,
/// no depth, right ones only if `pairs` are wanted). Throws InputError if there are none.
std::vector<std::filesystem::path> ListImages(const std::filesystem::path& folder, bool pairs,
                                              std::vector<std::string>* notes);

/// The same of a folder that may hold none.
std::vector<std::filesystem::path> ImagesIn(const std::filesystem::path& folder);

/// Left and right images that are joined side by side, as the City Centre and New College sets are used.
/// `images` = left, right, left, right...: keeps the left ones in it and returns the right ones. Throws
/// InputError that names `folder` if their number is odd.
std::vector<std::filesystem::path> TakeRightImages(const std::string& folder,
                                                   std::vector<std::filesystem::path>& images);

/// Both images as they are in their files, left beside right; the lower one gets a black border below. Empty
/// if one of them can't be read or their types differ. `cameras`: where left and right are in it.
cv::Mat ReadJoined(const std::filesystem::path& left, const std::filesystem::path& right,
                   std::vector<cv::Rect>* cameras = nullptr);

/// Where the depth of images is.
struct DepthArguments {
  std::string dataset;     ///< a data set with depth; empty: the one that the images belong to
  std::string camera;      ///< of the (colour and depth) images, as ParseCamera reads it; empty: as it says
  double units_per_m = 0;  ///< of 16-bit depth; 0: as the layout says
};

struct GroundTruthArguments {
  std::string file;  ///< a loop matrix or a trajectory; empty: there is none
  LoopRule rule;
  std::optional<double> overlap;  ///< a trajectory and depth: a loop is what two images share so much of
  double ignore_overlap = 0.1;    ///< and none is of what they share less; between the two: ignored
  DepthArguments depth;
  int stride = 1;
  bool join_pairs = false;  ///< each of the images is two, and the ground truth may be of the single ones
};

/// A pose for each image; none where it is not known.
using PosesOfImages = std::vector<std::optional<StampedPose>>;

/// The time stamps that images are named by, in their order; numbers of frames for a file of poses that has
/// such; empty if their names are none.
std::vector<double> StampsOfImages(const std::vector<std::filesystem::path>& images);

class DepthImages;

/// Ground truth for every stride-th of `images`: from a matrix over those or over all images, or from a
/// trajectory with a pose for each image. Where the images are named by their time stamps, the poses are
/// found by these (PoseOfFrame), and pairs with an image that has none are ignored. With join_pairs, a matrix
/// or trajectory over the single images is joined, too. Throws InputError that names both sizes.
/// `stamps`: of the images [s], in place of what they are named by; empty: not known. `depth`: for a ground
/// truth by overlap.
LoopGroundTruth LoadGroundTruth(const GroundTruthArguments& arguments,
                                const std::vector<std::filesystem::path>& images,
                                const std::vector<double>& stamps = {}, const DepthImages* depth = nullptr);

/// The images of a folder, or the frames of a video or a bag, with their ground truth.
struct ImageSet {
  std::vector<std::filesystem::path> images;  ///< every stride-th; of a recording: FILE/frame 12
  std::vector<std::filesystem::path> rights;  ///< beside each of them; empty without join_pairs
  LoopGroundTruth truth;                      ///< of a set without one: every pair is ignored
  std::shared_ptr<const Dataset> recording;   ///< a video or a bag; null: the images are files
  std::shared_ptr<const DepthImages> depth;   ///< where it was asked for
  std::vector<std::string> notes;             ///< what was left out of a folder
  int stride = 1;                             ///< of the images among the recording's frames

  /// The (left) image in colour or grey, as it is stored; empty where it can't be read.
  cv::Mat Read(std::size_t i) const;
  /// With `depth`: the image, rectified, and its depth [m], empty where there is none.
  std::pair<cv::Mat, cv::Mat> ReadWithDepth(std::size_t i) const;
};

/// The folder of images that a data set's folder holds, or the folder itself where it is no data set's, or
/// holds more images (a picture or two may lie beside a data set).
std::filesystem::path ImageFolder(const std::filesystem::path& folder);

/// Of a folder of images, a video, or a bag. A loop matrix that lies among the images is none of them.
/// `topic`: of a bag's images; empty: its only one. `camera`: of a recording, whose images are rectified with
/// it. `with_depth`: also where the ground truth needs none. Throws InputError.
ImageSet LoadImageSet(const std::string& path, const GroundTruthArguments& arguments,
                      const std::string& topic = "",
                      const std::optional<PinholeCamera>& camera = std::nullopt, bool with_depth = false);

}  // namespace tutti::cli
