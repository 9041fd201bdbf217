// Images in folders side by side, or in one: the layouts of layout.h.
#include <algorithm>
#include <cmath>
#include <map>

#include "frontend/dataset/dataset_folder.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

std::string PlaceOf(const fs::path& folder, const ImageRole& role) {
  return (*role.folder == '\0' ? folder : folder / role.folder).string();
}

// The first of the numbers of a name.
std::string FirstNumber(const std::string& key) { return key.substr(0, key.find(' ')); }

// Of each left image the one of the other role, or -1: by the numbers of their names, else by the first of
// them (Redwood: number and time), else by the times that they are called by.
std::vector<int> Partners(const std::vector<RoleImage>& left, const std::vector<RoleImage>& other,
                          double limit_s) {
  const auto by = [&](auto key_of) {
    std::map<std::string, int> place;
    for (std::size_t j = 0; j < other.size(); ++j) place.emplace(key_of(other[j].key), static_cast<int>(j));
    std::vector<int> found(left.size(), -1);
    for (std::size_t i = 0; i < left.size(); ++i) {
      const auto at = place.find(key_of(left[i].key));
      if (at != place.end() && !left[i].key.empty()) found[i] = at->second;
    }
    return found;
  };
  const auto enough = [&](const std::vector<int>& found) {
    return 2 * static_cast<std::size_t>(std::count(found.begin(), found.end(), -1)) <= left.size();
  };
  std::vector<int> found = by([](const std::string& key) { return key; });
  const bool stamped = std::all_of(left.begin(), left.end(), [](const auto& i) { return i.stamp_s; }) &&
                       std::all_of(other.begin(), other.end(), [](const auto& i) { return i.stamp_s; });
  if (enough(found)) return found;
  if (!stamped) return by(FirstNumber);
  std::vector<std::pair<double, std::size_t>> mine, theirs;
  for (std::size_t i = 0; i < left.size(); ++i) mine.emplace_back(*left[i].stamp_s, i);
  for (std::size_t j = 0; j < other.size(); ++j) theirs.emplace_back(*other[j].stamp_s, j);
  std::sort(mine.begin(), mine.end());
  std::sort(theirs.begin(), theirs.end());
  std::vector<double> a, b;
  for (const auto& entry : mine) a.push_back(entry.first);
  for (const auto& entry : theirs) b.push_back(entry.first);
  const std::vector<int> match = AssociateStamps(a, b, limit_s);
  std::fill(found.begin(), found.end(), -1);
  for (std::size_t i = 0; i < match.size(); ++i) {
    if (match[i] >= 0)
      found[mine[i].second] = static_cast<int>(theirs[static_cast<std::size_t>(match[i])].second);
  }
  return found;
}

// The numbers that images count by, if they do; else their places.
std::vector<std::int64_t> CountsOf(const std::vector<RoleImage>& images) {
  std::vector<std::int64_t> counts, places;
  for (const RoleImage& image : images) {
    places.push_back(static_cast<std::int64_t>(places.size()));
    const std::optional<long long> number = ParseInteger(FirstNumber(image.key));
    if (number && (counts.empty() || *number > counts.back())) counts.push_back(*number);
  }
  const bool grow = counts.size() == images.size();
  return grow && counts.back() - counts.front() <= 100 * static_cast<std::int64_t>(counts.size()) ? counts
                                                                                                  : places;
}

// Time stamps of the left images: of the layout's list, of their names, or by their numbers.
class Stamper {
 public:
  Stamper(const fs::path& folder, const Layout& layout, const DatasetOptions& options,
          const std::vector<RoleImage>& images, FolderContents& out)
      : images_(images), list_(folder / layout.stamps), out_(out) {
    out.rate_hz = options.rate_hz > 0 ? options.rate_hz : layout.rate_hz > 0 ? layout.rate_hz : 10;
    std::error_code ignored;
    if (*layout.stamps != '\0' && fs::is_regular_file(list_, ignored)) {
      for (const auto& [line, stamp] : ReadLayoutStamps(list_)) lines_.emplace_back(line, stamp);
      numbers_ = CountsOf(images);
      if (static_cast<std::int64_t>(lines_.size()) <= numbers_.back())
        throw InputError(list_.string() + ": has " + std::to_string(lines_.size()) +
                         " time stamps, but there are images up to number " +
                         std::to_string(numbers_.back()) + "; one line for each image is needed");
      return;
    }
    by_name_ = images.size() > 1;
    for (std::size_t i = 0; i < images.size() && by_name_; ++i)
      by_name_ = images[i].stamp_s && (i == 0 || *images[i].stamp_s > *images[i - 1].stamp_s);
    numbers_ = CountsOf(images);
    if (!by_name_ && options.rate_hz <= 0 && layout.rate_hz <= 0)
      out.warnings.push_back(folder.string() + ": no time stamps; 10 images a second are assumed (rate_hz)");
  }

  /// Of image i, or nothing if its line is refused.
  std::optional<double> Of(std::size_t i, StampOrder& order) const {
    if (by_name_) return *images_[i].stamp_s;
    if (lines_.empty()) return static_cast<double>(numbers_[i]) / out_.rate_hz;
    const auto& [line, stamp] = lines_[static_cast<std::size_t>(numbers_[i])];
    return order.Accept(line, stamp) ? std::optional<double>(stamp) : std::nullopt;
  }
  const fs::path& list() const { return list_; }

 private:
  const std::vector<RoleImage>& images_;
  fs::path list_;
  FolderContents& out_;
  std::vector<std::pair<std::size_t, double>> lines_;
  std::vector<std::int64_t> numbers_;
  bool by_name_ = false;
};

void PlaceTruth(const fs::path& folder, const Layout& layout, FolderContents& out) {
  out.truth_places = {folder / "groundtruth.txt", folder / "poses.txt", folder / "groundtruth_tum.txt"};
  if (layout.form == TruthForm::kNone) return;
  LayoutTruth& truth = out.truth.emplace();
  truth.form = layout.form;
  truth.place = *layout.truth == '\0' ? folder : folder / layout.truth;
  truth.role = {"", layout.truth_word};
}

void SetCalibration(const fs::path& folder, const FoundLayout& found, const DatasetOptions& options,
                    FolderContents& out) {
  cv::Size size;
  for (std::size_t i = 0; i < std::min<std::size_t>(50, out.frames.size()) && size.empty(); ++i)
    size = ReadGreyFile(out.frames[i].image).image.size();
  if (size.empty()) return;  // FolderDataset says so
  LayoutCalibration known = ReadLayoutCalibration(folder, found, size);
  out.left = options.camera ? options.camera : known.rig.left;
  out.T_body_left = known.rig.T_body_left;
  out.baseline_m = options.baseline_m;
  if (!options.camera) {
    out.right = known.rig.right;
    out.T_right_left = known.rig.T_right_left;
    if (out.baseline_m == 0) out.baseline_m = known.rig.baseline_m;
  }
  out.warnings.insert(out.warnings.end(), known.notes.begin(), known.notes.end());
  out.depth = FormatOfDepth(*found.layout);
  out.depth.camera = known.depth;
  if (!out.left) out.warnings.push_back(NoCalibrationText(folder.string()));
}

}  // namespace

DepthFormat FormatOfDepth(const Layout& layout) {
  DepthFormat format;
  format.units_per_m = layout.depth_units_per_m;
  format.same_view = layout.form == TruthForm::kOdometry;
  format.float_in_png = layout.float_in_png;
  return format;
}

FolderContents FindPaired(const fs::path& folder, const DatasetOptions& options) {
  const std::optional<FoundLayout> found = FindLayout(folder);
  if (!found && IsStrayScanner(folder))
    throw InputError(folder.string() +
                     ": is a video of Stray Scanner, which can't be followed; leave --follow out");
  if (!found)
    throw InputError(folder.string() +
                     ": holds no left and right, or colour and depth, images of a known layout "
                     "(data/README.md shows them)");
  const Layout& layout = *found->layout;
  FolderContents out;
  out.folder = folder;
  const std::vector<RoleImage> images = ImagesOf(folder, layout.left);
  const bool stereo = options.sensor == Sensor::kStereo, rgbd = options.sensor == Sensor::kRgbd;
  const char* const what = stereo ? "right" : "depth";
  if ((stereo && !found->right) || (rgbd && !found->depth))
    throw InputError(folder.string() + ": " + found->Text() + " has no " + what + " images" +
                     (stereo || layout.depth.folder == nullptr ? "" : " of 16 bit, or of floats") +
                     "; set sensor to " +
                     (found->depth   ? "rgbd or "
                      : found->right ? "stereo or "
                                     : "") +
                     "mono");
  std::vector<RoleImage> others;
  if (stereo || rgbd) others = ImagesOf(folder, stereo ? layout.right : layout.depth);
  constexpr double kSamePair_s = 2.5e-3;
  const std::vector<int> partners =
      Partners(images, others, stereo ? kSamePair_s : options.max_association_s);
  const Stamper stamper(folder, layout, options, images, out);
  StampOrder order(stamper.list(), out.warnings);
  std::size_t alone = 0;
  PlaceTruth(folder, layout, out);
  for (std::size_t i = 0; i < images.size(); ++i) {
    const std::optional<double> stamp = stamper.Of(i, order);
    if (out.truth) out.truth->stamps.emplace_back(images[i].key, stamp.value_or(std::nan("")));
    if (!stamp) continue;
    FrameFiles frame;
    frame.stamp_s = *stamp;
    frame.image = images[i].file;
    if (partners[i] < 0)
      ++alone;
    else
      (stereo ? frame.right : frame.depth) = others[static_cast<std::size_t>(partners[i])].file;
    out.pose_stamps.emplace_back(static_cast<std::int64_t>(i), *stamp);
    out.frames.push_back(std::move(frame));
  }
  out.pose_count = images.size();
  if (stereo || rgbd) {
    const fs::path place = PlaceOf(folder, stereo ? layout.right : layout.depth);
    if (alone == out.frames.size())
      throw InputError(place.string() + ": no " + what + " image has the number or the time of an image of " +
                       PlaceOf(folder, layout.left));
    WarnOfFramesWithoutDepth(place, alone,
                             "images have no " + std::string(what) + " image and are tracked without",
                             options, &out);
  }
  if (out.frames.size() > 1)
    out.rate_hz =
        static_cast<double>(out.frames.size() - 1) / (out.frames.back().stamp_s - out.frames.front().stamp_s);
  SetCalibration(folder, *found, options, out);
  return out;
}

}  // namespace tutti
