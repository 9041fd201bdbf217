#include "frontend/dataset/layout.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <map>

#include "frontend/dataset/image_file.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

PinholeCamera PublishedCamera(int width, int height, double f, double cx, double cy) {
  PinholeCamera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = f;
  camera.cx = cx;
  camera.cy = cy;
  return camera;
}

std::vector<Layout> MakeLayouts() {
  std::vector<Layout> all;
  const auto add = [&all](const char* name, ImageRole left, ImageRole right, ImageRole depth) -> Layout& {
    all.push_back({name, left, right, depth});
    return all.back();
  };
  // The data sets' own pages and tools are the source of units, cameras and conventions.
  const auto kitti = [&](const char* left, const char* right, const char* stamps) {
    Layout& raw = add("KITTI raw", {left}, {right}, {});
    raw.sign =
        "image_00/timestamps.txt|image_02/timestamps.txt|oxts|../calib_cam_to_cam.txt|calib_cam_to_cam.txt";
    raw.stamps = stamps;
    raw.rate_hz = 10;
    raw.truth = "oxts/data";
    raw.form = TruthForm::kOxts;
  };
  kitti("image_00/data", "image_01/data", "image_00/timestamps.txt");
  kitti("image_02/data", "image_03/data", "image_02/timestamps.txt");
  const auto tartan = [&](const char* name, ImageRole left, ImageRole right, ImageRole depth) -> Layout& {
    Layout& air = add(name, left, right, depth);
    air.baseline_m = 0.25;
    air.depth_units_per_m = 1;
    air.form = TruthForm::kLines;
    air.forward_right_down = true;
    return air;
  };
  Layout& first = tartan("TartanAir", {"image_left"}, {"image_right"}, {"depth_left"});
  first.sign = "pose_left.txt|depth_left";
  first.published = PublishedCamera(640, 480, 320, 320, 240);
  first.truth = "pose_left.txt";
  Layout& second = tartan("TartanAir V2", {"image_lcam_front"}, {"image_rcam_front"}, {"depth_lcam_front"});
  second.published = PublishedCamera(640, 640, 320, 320, 320);
  second.truth = "pose_lcam_front.txt";
  second.float_in_png = true;

  Layout& scannet = add("ScanNet", {"color"}, {}, {"depth"});
  scannet.sign = "pose";
  scannet.intrinsics = "intrinsic/intrinsic_color.txt";
  scannet.depth_intrinsics = "intrinsic/intrinsic_depth.txt";
  scannet.depth_units_per_m = 1000;
  scannet.rate_hz = 30;
  scannet.truth = "pose";
  scannet.form = TruthForm::kFiles;
  Layout& scenes = add("7-Scenes", {"", "frame-*.color"}, {}, {"", "frame-*.depth"});
  scenes.depth_units_per_m = 1000;
  scenes.rate_hz = 30;
  scenes.truth_word = "frame-*.pose";
  scenes.form = TruthForm::kFiles;
  scenes.pairs = true;
  const auto replica = [&](const char* images, const char* above, const char* calibration) {
    Layout& r = add("Replica", {images, "frame"}, {}, {images, "depth"});
    r.sign = above;
    r.calibration = calibration;
    r.published = PublishedCamera(1200, 680, 600, 599.5, 339.5);
    r.depth_units_per_m = 6553.5;
    r.rate_hz = 30;
    r.truth = above;
    r.form = TruthForm::kLines;
    r.pairs = true;
  };
  replica("results", "traj.txt", "cam_params.json|../cam_params.json");
  replica("", "../traj.txt", "../cam_params.json|../../cam_params.json");
  for (const char* colour : {"color", "image", "rgb"}) {
    Layout& open3d = add("Open3D", {colour}, {}, {"depth"});
    open3d.sign = "camera_intrinsic.json|intrinsic.json|camera_primesense.json|camera.json|trajectory.log";
    open3d.calibration = "camera_intrinsic.json|intrinsic.json|camera_primesense.json|camera.json";
    open3d.depth_units_per_m = 1000;
    open3d.rate_hz = 30;
    open3d.truth = "trajectory.log";
    open3d.form = TruthForm::kLog;
  }
  // Images that a program took out of Stray Scanner's video.
  Layout& stray = add("Stray Scanner", {"rgb"}, {}, {"depth"});
  stray.sign = "odometry.csv";
  stray.intrinsics = "camera_matrix.csv";
  stray.depth_units_per_m = 1000;
  stray.truth = "odometry.csv";
  stray.form = TruthForm::kOdometry;

  // Nobody's in particular.
  for (const auto& [left, right] : {std::pair("cam0", "cam1"),
                                    {"left", "right"},
                                    {"image_left", "image_right"},
                                    {"images_left", "images_right"},
                                    {"cam_left", "cam_right"},
                                    {"infra1", "infra2"},
                                    {"l", "r"},
                                    {"L", "R"}})
    add("", {left}, {right}, {"depth"});
  for (const char* colour : {"rgb", "color", "colour", "image", "images"}) add("", {colour}, {}, {"depth"});
  for (const auto& [left, right] : {std::pair("left", "right"), {"cam0", "cam1"}, {"l", "r"}})
    add("", {"", left}, {"", right}, {}).pairs = true;
  for (const char* colour : {"color", "colour", "rgb", "frame", "!depth"})
    add("", {"", colour}, {}, {"", "depth"}).pairs = true;
  return all;
}

const std::vector<Layout>& Layouts() {
  static const std::vector<Layout> layouts = MakeLayouts();
  return layouts;
}

bool IsLetter(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; }
bool IsDigit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

// Where the word stands alone in the name: no letter is beside it.
std::size_t FindWord(const std::string& name, const std::string& word) {
  std::string lower = name;
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  for (std::size_t at = lower.find(word); at != std::string::npos; at = lower.find(word, at + 1)) {
    const std::size_t end = at + word.size();
    const bool digit = IsDigit(word.back()) && end < name.size() && IsDigit(name[end]);  // cam01
    if ((at == 0 || !IsLetter(name[at - 1])) && (end == name.size() || !IsLetter(name[end])) && !digit)
      return at;
  }
  return std::string::npos;
}

// The name without the role's word; nothing if it is not of the role.
std::optional<std::string> WithoutWord(const std::string& name, const std::string& word) {
  if (word.empty()) return name;
  if (word.front() == '!')
    return FindWord(name, word.substr(1)) == std::string::npos ? std::optional<std::string>(name)
                                                               : std::nullopt;
  const std::size_t star = word.find('*');
  if (star != std::string::npos) {
    const std::size_t ends = word.size() - 1;  // of begin and end together
    const std::string end = word.substr(star + 1);
    if (name.size() <= ends || name.compare(0, star, word, 0, star) != 0 ||
        name.compare(name.size() - end.size(), end.size(), end) != 0)
      return std::nullopt;
    return name.substr(star, name.size() - ends);
  }
  const std::size_t at = FindWord(name, word);
  if (at == std::string::npos) return std::nullopt;
  return name.substr(0, at) + " " + name.substr(at + word.size());
}

// "frame-000012" -> "12", "00012-000000000400" -> "12 400".
std::string NumbersIn(const std::string& name) {
  std::string key;
  for (std::size_t i = 0; i < name.size();) {
    if (!IsDigit(name[i])) {
      ++i;
      continue;
    }
    std::size_t end = i;
    while (end < name.size() && IsDigit(name[end])) ++end;
    while (i + 1 < end && name[i] == '0') ++i;
    key += (key.empty() ? "" : " ") + name.substr(i, end - i);
    i = end;
  }
  return key;
}

// One of "a|b" that is there, or nothing.
std::optional<fs::path> OneOf(const fs::path& folder, const std::string& names) {
  std::error_code ignored;
  for (const std::string& name : SplitText(names, "|")) {
    if (fs::exists(folder / name, ignored)) return folder / name;
  }
  return std::nullopt;
}

// Pictures made of depth are none.
bool IsDepth(const Layout& layout, const fs::path& file) {
  if (*layout.name != '\0') return true;
  return ReadDepthFile(file).error.empty();
}

bool IsImageOrArray(const fs::path& file) { return HasImageExtension(file) || file.extension() == ".npy"; }

std::vector<RoleImage> Select(const std::vector<fs::path>& files, const ImageRole& role) {
  std::vector<RoleImage> images;
  std::vector<std::string> names;
  for (const fs::path& file : files) {
    const std::optional<std::string> rest = WithoutWord(file.stem().string(), role.word);
    if (!rest) continue;
    images.push_back({NumbersIn(*rest), std::nullopt, file});
    names.push_back(*rest);
  }
  const internal::StampsOfNames found = internal::FindStamps(names);
  if (found.stamps.size() != images.size()) return images;
  std::vector<RoleImage> by_time;
  for (const auto& [stamp, i] : found.stamps) by_time.push_back({images[i].key, stamp, images[i].file});
  return by_time;
}

// What lies in the folder itself.
struct Listing {
  std::vector<fs::path> files;
  bool images = false;
  bool partners = false;  // some names say that they are right or depth images; else most rows need no look
};

Listing ListingOf(const fs::path& folder) {
  Listing listing{ListFiles(folder, IsImageOrArray)};
  for (const fs::path& file : listing.files) {
    listing.images = listing.images || HasImageExtension(file);
    const std::string name = file.stem().string();
    for (const char* word : {"depth", "right", "cam1", "r"})
      listing.partners = listing.partners || FindWord(name, word) != std::string::npos;
  }
  return listing;
}

std::optional<FoundLayout> Match(const fs::path& folder, const Layout& layout, const Listing& listing) {
  std::error_code ignored;
  const bool anonymous = *layout.name == '\0', inside = *layout.left.folder == '\0';
  if (anonymous && !inside && listing.images) return std::nullopt;  // a folder of images, whatever is below
  if (inside ? !listing.images || !listing.partners : !fs::is_directory(folder / layout.left.folder, ignored))
    return std::nullopt;
  if (*layout.sign != '\0' && !OneOf(folder, layout.sign)) return std::nullopt;
  const auto images = [&](const ImageRole& role) {
    return inside ? Select(listing.files, role) : ImagesOf(folder, role);
  };
  const auto left = images(layout.left);
  if (left.empty()) return std::nullopt;
  FoundLayout found{&layout};
  if (layout.right.folder != nullptr) found.right = 2 * images(layout.right).size() > left.size();
  if (layout.depth.folder != nullptr) {
    const auto depth = images(layout.depth);
    found.depth = !depth.empty() && IsDepth(layout, depth.front().file);
    // Names without the word may be of anything; those with it say what they are.
    if (inside && 2 * left.size() < depth.size()) return std::nullopt;
    if (layout.pairs && !depth.empty()) return found;
  }
  if (layout.pairs && !found.right) return std::nullopt;
  return found;
}

// Types that make up less than a tenth of the images.
void DropStrayTypes(const fs::path& folder, std::vector<fs::path>& files, std::vector<std::string>* notes) {
  std::map<std::string, std::size_t> counts;
  for (const fs::path& file : files) ++counts[file.extension().string()];
  const std::size_t all = files.size();
  for (const auto& [extension, count] : counts) {
    if (10 * count >= all) continue;
    const std::string& type = extension;
    files.erase(std::remove_if(files.begin(), files.end(),
                               [&](const fs::path& f) { return f.extension().string() == type; }),
                files.end());
    if (notes == nullptr) continue;
    notes->push_back(folder.string() + ": " + std::to_string(count) + " " + type + " image(s) among " +
                     std::to_string(all) + " images of other types are left out");
  }
}

}  // namespace

std::string FoundLayout::Text() const {
  std::vector<std::string> parts;
  const auto add = [&parts](const ImageRole& role, const char* what) {
    std::string text = role.folder;
    if (*role.word != '\0' && *role.word != '!') text += (text.empty() ? "" : "/") + std::string(role.word);
    parts.push_back(text.empty() ? what : text);
  };
  add(layout->left, "images");
  if (right) add(layout->right, "right");
  if (depth) add(layout->depth, "depth");
  const std::string name = *layout->name != '\0' ? layout->name
                           : right               ? "left and right images"
                           : depth               ? "colour and depth images"
                                                 : "a folder of images";
  return name + " (" + JoinText(parts) + ")";
}

bool IsStrayScanner(const fs::path& folder) {
  std::error_code ignored;
  return fs::is_regular_file(folder / "rgb.mp4", ignored) &&
         (fs::exists(folder / "camera_matrix.csv", ignored) || fs::exists(folder / "odometry.csv", ignored));
}

std::optional<FoundLayout> FindLayout(const fs::path& folder) {
  const Listing listing = ListingOf(folder);
  for (const Layout& layout : Layouts()) {
    if (std::optional<FoundLayout> found = Match(folder, layout, listing)) return found;
  }
  return std::nullopt;
}

bool HasStamps(const fs::path& folder) {
  if (IsStrayScanner(folder)) return true;
  const std::optional<FoundLayout> found = FindLayout(folder);
  if (!found) return false;
  if (*found->layout->stamps != '\0' && OneOf(folder, found->layout->stamps)) return true;
  const std::vector<RoleImage> images = ImagesOf(folder, found->layout->left);
  return std::all_of(images.begin(), images.end(), [](const RoleImage& i) { return i.stamp_s; });
}

std::vector<RoleImage> ImagesOf(const fs::path& folder, const ImageRole& role, const std::string& extension) {
  if (role.folder == nullptr) return {};
  return Select(ListFiles(*role.folder == '\0' ? folder : folder / role.folder,
                          [&](const fs::path& file) {
                            return extension.empty() ? IsImageOrArray(file) : file.extension() == extension;
                          }),
                role);
}

std::vector<fs::path> FramesIn(const fs::path& folder, bool pairs, std::vector<std::string>* notes) {
  std::vector<fs::path> files = ListImages(folder);
  DropStrayTypes(folder, files, notes);
  const std::optional<FoundLayout> found = FindLayout(folder);
  if (!found || *found->layout->left.folder != '\0') return files;
  std::vector<fs::path> frames;
  for (const RoleImage& image : ImagesOf(folder, found->layout->left)) frames.push_back(image.file);
  if (pairs && found->right) return files;
  if (notes != nullptr)
    notes->push_back(folder.string() + ": " + found->Text() + "; the " + std::to_string(frames.size()) + " " +
                     (found->right ? "left" : "colour") + " images are used");
  return frames;
}

}  // namespace tutti
