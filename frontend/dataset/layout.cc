#include "frontend/dataset/layout.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <functional>
#include <map>

#include "frontend/dataset/image_file.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

using AddLayout = std::function<Layout&(const char* name, ImageRole left, ImageRole right, ImageRole depth,
                                        const char* sign)>;

// The data sets' own pages and tools are the source of units, cameras and conventions.
void AddPublished(const AddLayout& add) {
  for (const auto& [left, right, stamps] :
       {std::array{"image_00/data", "image_01/data", "image_00/timestamps.txt"},
        {"image_02/data", "image_03/data", "image_02/timestamps.txt"}}) {
    Layout& raw = add(
        "KITTI raw", {left}, {right}, {},
        "image_00/timestamps.txt|image_02/timestamps.txt|oxts|../calib_cam_to_cam.txt|calib_cam_to_cam.txt");
    raw.stamps = stamps;
    raw.rate_hz = 10;
    raw.truth = {TruthForm::kOxts, "oxts/data"};
  }
  const auto tartan = [](Layout& air, int height, const char* truth) -> Layout& {
    air.baseline_m = 0.25;
    air.depth_units_per_m = 1;
    air.published = Pinhole(320, 320, 320, height / 2, {640, height});
    air.truth = {TruthForm::kLines, truth};
    air.forward_right_down = true;
    return air;
  };
  tartan(add("TartanAir", {"image_left"}, {"image_right"}, {"depth_left"}, "pose_left.txt|depth_left"), 480,
         "pose_left.txt");
  tartan(add("TartanAir V2", {"image_lcam_front"}, {"image_rcam_front"}, {"depth_lcam_front"}, ""), 640,
         "pose_lcam_front.txt")
      .float_in_png = true;

  const auto rgbd = [](Layout& layout, double units_per_m, double rate_hz, TruthPlace truth) -> Layout& {
    layout.depth_units_per_m = units_per_m;
    layout.rate_hz = rate_hz;
    layout.truth = truth;
    return layout;
  };
  Layout& scannet =
      rgbd(add("ScanNet", {"color"}, {}, {"depth"}, "pose"), 1000, 30, {TruthForm::kFiles, "pose"});
  scannet.intrinsics = "intrinsic/intrinsic_color.txt";
  scannet.depth_intrinsics = "intrinsic/intrinsic_depth.txt";
  rgbd(add("7-Scenes", {"", "frame-*.color"}, {}, {"", "frame-*.depth"}, ""), 1000, 30,
       {TruthForm::kFiles, "", "frame-*.pose"})
      .pairs = true;
  for (const auto& [images, truth, calibration] :
       {std::array{"results", "traj.txt", "cam_params.json|../cam_params.json"},
        {"", "../traj.txt", "../cam_params.json|../../cam_params.json"}}) {
    Layout& replica = rgbd(add("Replica", {images, "frame"}, {}, {images, "depth"}, truth), 6553.5, 30,
                           {TruthForm::kLines, truth});
    replica.calibration = calibration;
    replica.published = Pinhole(600, 600, 599.5, 339.5, {1200, 680});
    replica.pairs = true;
  }
  for (const char* colour : {"color", "image", "rgb"})
    rgbd(add("Open3D", {colour}, {}, {"depth"},
             "camera_intrinsic.json|intrinsic.json|camera_primesense.json|camera.json|trajectory.log"),
         1000, 30, {TruthForm::kLog, "trajectory.log"})
        .calibration = "camera_intrinsic.json|intrinsic.json|camera_primesense.json|camera.json";
  // Images that a program took out of Stray Scanner's video.
  rgbd(add("Stray Scanner", {"rgb"}, {}, {"depth"}, "odometry.csv"), 1000, 0,
       {TruthForm::kOdometry, "odometry.csv"})
      .intrinsics = "camera_matrix.csv";
}

// Layouts of nobody in particular.
void AddAnonymous(const AddLayout& to) {
  const auto add = [&to](ImageRole left, ImageRole right, ImageRole depth) -> Layout& {
    return to("", left, right, depth, "");
  };
  for (const auto& [left, right] : {std::pair("cam0", "cam1"),
                                    {"left", "right"},
                                    {"image_left", "image_right"},
                                    {"images_left", "images_right"},
                                    {"cam_left", "cam_right"},
                                    {"infra1", "infra2"},
                                    {"l", "r"},
                                    {"L", "R"}})
    add({left}, {right}, {"depth"});
  for (const char* colour : {"rgb", "color", "colour", "image", "images"}) add({colour}, {}, {"depth"});
  for (const auto& [left, right] : {std::pair("left", "right"), {"cam0", "cam1"}, {"l", "r"}})
    add({"", left}, {"", right}, {}).pairs = true;
  for (const char* colour : {"color", "colour", "rgb", "frame", "!depth"})
    add({"", colour}, {}, {"", "depth"}).pairs = true;
}

const std::vector<Layout>& Layouts() {
  static const std::vector<Layout> layouts = [] {
    std::vector<Layout> all;
    const AddLayout add = [&all](const char* name, ImageRole left, ImageRole right, ImageRole depth,
                                 const char* sign) -> Layout& {
      return all.emplace_back(Layout{name, left, right, depth, sign});
    };
    AddPublished(add);
    AddAnonymous(add);
    return all;
  }();
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
  for (std::size_t i = 0, end = 0; i < name.size(); i = std::max(i + 1, end)) {
    for (end = i; end < name.size() && IsDigit(name[end]);) ++end;
    if (end == i) continue;
    while (i + 1 < end && name[i] == '0') ++i;
    key += (key.empty() ? "" : " ") + name.substr(i, end - i);
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
    // Pictures made of depth are none.
    found.depth = !depth.empty() && (!anonymous || ReadDepthFile(depth.front().file).error.empty());
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
  for (const auto& count : counts) {
    if (10 * count.second >= all) continue;
    files.erase(std::remove_if(files.begin(), files.end(),
                               [&](const fs::path& f) { return f.extension().string() == count.first; }),
                files.end());
    if (notes == nullptr) continue;
    notes->push_back(folder.string() + ": " + std::to_string(count.second) + " " + count.first +
                     " image(s) among " + std::to_string(all) + " images of other types are left out");
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
  const auto wanted = [&](const fs::path& file) {
    return extension.empty() ? IsImageOrArray(file) : file.extension() == extension;
  };
  return Select(ListFiles(*role.folder == '\0' ? folder : folder / role.folder, wanted), role);
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
