// Images in folders side by side, or in one: the layouts of layout.h.
#include <algorithm>
#include <cmath>

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

// The image of the other role that belongs to each left one, or -1: by the numbers of their names, else by
// the first of them (Redwood: number and time), else by the times that they are called by.
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
  std::vector<int> found = by([](const std::string& key) { return key; });
  if (2 * static_cast<std::size_t>(std::count(found.begin(), found.end(), -1)) <= left.size()) return found;
  std::vector<double> a, b;  // growing
  for (const RoleImage& image : left) a.push_back(image.stamp_s.value_or(std::nan("")));
  for (const RoleImage& image : other) b.push_back(image.stamp_s.value_or(std::nan("")));
  const bool stamped = std::none_of(a.begin(), a.end(), [](double s) { return std::isnan(s); }) &&
                       std::none_of(b.begin(), b.end(), [](double s) { return std::isnan(s); });
  return stamped ? AssociateStamps(a, b, limit_s) : by(FirstNumber);
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

// Time stamps of the left images: of the layout's list, of their names, or by their numbers. Nothing for an
// image whose line is refused. Sets the rate where nothing is known of it.
std::vector<std::optional<double>> StampsOfLayout(const fs::path& folder, const Layout& layout,
                                                  const DatasetOptions& options,
                                                  const std::vector<RoleImage>& images, FolderContents& out) {
  std::vector<std::optional<double>> stamps;
  const fs::path list = folder / layout.stamps;
  const std::vector<std::int64_t> numbers = CountsOf(images);
  const double known_hz = options.rate_hz > 0 ? options.rate_hz : layout.rate_hz;
  out.rate_hz = known_hz > 0 ? known_hz : 10;
  std::error_code ignored;
  if (*layout.stamps != '\0' && fs::is_regular_file(list, ignored)) {
    const auto lines = ReadLayoutStamps(list);
    if (static_cast<std::int64_t>(lines.size()) <= numbers.back())
      throw InputError(list.string() + ": has " + std::to_string(lines.size()) +
                       " time stamps, but there are images up to number " + std::to_string(numbers.back()) +
                       "; one line for each image is needed");
    StampOrder order(list, out.warnings);
    for (const std::int64_t number : numbers) {
      const auto& [line, stamp] = lines[static_cast<std::size_t>(number)];
      stamps.push_back(order.Accept(line, stamp) ? std::optional<double>(stamp) : std::nullopt);
    }
  } else if (images.size() > 1 && images.front().stamp_s) {
    for (const RoleImage& image : images) stamps.push_back(image.stamp_s);
  } else {
    if (known_hz <= 0)
      out.warnings.push_back(folder.string() + ": no time stamps; 10 images a second are assumed (rate_hz)");
    for (const std::int64_t number : numbers) stamps.emplace_back(static_cast<double>(number) / out.rate_hz);
  }
  return stamps;
}

void PlaceTruth(const fs::path& folder, const Layout& layout, FolderContents& out) {
  out.truth_places = {folder / "groundtruth.txt", folder / "poses.txt", folder / "groundtruth_tum.txt"};
  if (layout.truth.form == TruthForm::kNone) return;
  out.truth.emplace(LayoutTruth{*layout.truth.name == '\0' ? folder : folder / layout.truth.name,
                                layout.truth.form,
                                {"", layout.truth.word},
                                {}});
}

void SetCalibration(const fs::path& folder, const FoundLayout& found, const DatasetOptions& options,
                    FolderContents& out) {
  cv::Size size;
  for (std::size_t i = 0; i < std::min<std::size_t>(50, out.frames.size()) && size.empty(); ++i)
    size = ReadGreyFile(out.frames[i].image).image.size();
  if (size.empty()) return;  // FolderDataset says so
  const LayoutCalibration known = ReadLayoutCalibration(folder, found, size);
  out.rig = known.rig;
  if (options.camera) {
    out.rig.left = options.camera;
    out.rig.right.reset();
    out.rig.T_right_left.reset();
  }
  if (options.camera || options.baseline_m != 0) out.rig.baseline_m = options.baseline_m;
  out.warnings.insert(out.warnings.end(), known.notes.begin(), known.notes.end());
  out.depth = FormatOfDepth(*found.layout);
  out.depth.camera = known.depth;
  if (!out.rig.left) out.warnings.push_back(NoCalibrationText(folder.string()));
}

FoundLayout LayoutOf(const fs::path& folder, Sensor sensor) {
  const std::optional<FoundLayout> found = FindLayout(folder);
  if (!found && IsStrayScanner(folder))
    throw InputError(folder.string() +
                     ": is a video of Stray Scanner, which can't be followed; leave --follow out");
  if (!found)
    throw InputError(folder.string() +
                     ": holds no left and right, or colour and depth, images of a known layout "
                     "(data/README.md shows them)");
  const bool stereo = sensor == Sensor::kStereo;
  if (sensor == Sensor::kMono || (stereo ? found->right : found->depth)) return *found;
  throw InputError(folder.string() + ": " + found->Text() + " has no " +
                   (stereo ? "right images" : "depth images") +
                   (stereo || found->layout->depth.folder == nullptr ? "" : " of 16 bit, or of floats") +
                   "; set sensor to " +
                   (found->depth   ? "rgbd or "
                    : found->right ? "stereo or "
                                   : "") +
                   "mono");
}

}  // namespace

DepthFormat FormatOfDepth(const Layout& layout) {
  return {layout.depth_units_per_m, std::nullopt, layout.truth.form == TruthForm::kOdometry,
          layout.float_in_png};
}

FolderContents FindPaired(const fs::path& folder, const DatasetOptions& options) {
  const FoundLayout found = LayoutOf(folder, options.sensor);
  const Layout& layout = *found.layout;
  const bool stereo = options.sensor == Sensor::kStereo, pairs = options.sensor != Sensor::kMono;
  FolderContents out;
  out.folder = folder;
  const std::vector<RoleImage> images = ImagesOf(folder, layout.left);
  const ImageRole& other = stereo ? layout.right : layout.depth;
  std::vector<RoleImage> others;
  if (pairs) others = ImagesOf(folder, other);
  constexpr double kSamePair_s = 2.5e-3;
  const std::vector<int> partners =
      Partners(images, others, stereo ? kSamePair_s : options.max_association_s);
  const std::vector<std::optional<double>> stamps = StampsOfLayout(folder, layout, options, images, out);
  std::size_t alone = 0;
  PlaceTruth(folder, layout, out);
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (out.truth) out.truth->stamps.emplace_back(images[i].key, stamps[i].value_or(std::nan("")));
    if (!stamps[i]) continue;
    FrameFiles frame;
    frame.stamp_s = *stamps[i];
    frame.image = images[i].file;
    if (partners[i] < 0)
      ++alone;
    else
      (stereo ? frame.right : frame.depth) = others[static_cast<std::size_t>(partners[i])].file;
    out.pose_stamps.emplace_back(static_cast<std::int64_t>(i), *stamps[i]);
    out.frames.push_back(std::move(frame));
  }
  out.pose_count = images.size();
  if (pairs) {
    const std::string what = stereo ? "right" : "depth";
    out.ReportAlone(
        PlaceOf(folder, other), alone,
        "no " + what + " image has the number or the time of an image of " + PlaceOf(folder, layout.left),
        "images have no " + what + " image and are tracked without", options);
  }
  out.MeasureRate();
  SetCalibration(folder, found, options, out);
  return out;
}

}  // namespace tutti
