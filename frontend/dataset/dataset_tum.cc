// TUM RGB-D: rgb.txt, depth.txt, groundtruth.txt; or associations.txt (TUM's and ICL-NUIM's).
#include <algorithm>
#include <cmath>
#include <opencv2/core/persistence.hpp>
#include <tuple>

#include "core/time_stamps.h"
#include "frontend/dataset/dataset_folder.h"
#include "frontend/dataset/regular_clock.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

struct StampedFile {
  double stamp_s = 0;
  fs::path file;
};

// OpenLORIS-Scene: its D435i's colour camera in the frame of the robot (base_link), whose poses the ground
// truth has. sensors.yaml has fx cx fy cy; matrices of trans_matrix.yaml take points of the child into the
// parent.
constexpr const char* kLorisCamera = "d400_color_optical_frame";

std::vector<double> MatrixOf(const fs::path& file, const cv::FileNode& node, std::size_t count) {
  cv::Mat values;
  node >> values;
  if (values.total() != count || values.channels() != 1)
    throw InputError(file.string() + ": a matrix of " + std::to_string(count) + " numbers is needed for " +
                     kLorisCamera);
  values = values.reshape(1, 1);
  values.convertTo(values, CV_64F);
  return {values.ptr<double>(0), values.ptr<double>(0) + count};
}

Pose LorisMount(const fs::path& file) {
  const cv::FileStorage storage(file.string(), cv::FileStorage::READ);
  Pose T_base_camera;
  std::string frame = kLorisCamera;
  const cv::FileNode transforms = storage["trans_matrix"];
  for (std::size_t tried = 0; frame != "base_link"; ++tried) {
    auto found = transforms.begin();
    while (found != transforms.end() && static_cast<std::string>((*found)["child_frame"]) != frame) ++found;
    if (found == transforms.end() || tried > transforms.size())
      throw InputError(file.string() + ": no transforms lead from " + kLorisCamera + " to base_link");
    const std::vector<double> v = MatrixOf(file, (*found)["matrix"], 16);
    TransformRows rows;
    std::copy(v.begin(), v.end(), rows.begin());
    const std::optional<Pose> T = RigidTransform(rows);
    if (!T) throw InputError(file.string() + ": a transform is zero");
    T_base_camera = *T * T_base_camera;
    frame = static_cast<std::string>((*found)["parent_frame"]);
  }
  return T_base_camera;
}

LayoutCalibration ReadLoris(const fs::path& folder) {
  LayoutCalibration out;
  std::error_code code;
  const fs::path sensors = folder / "sensors.yaml", mount = folder / "trans_matrix.yaml";
  try {
    if (fs::is_regular_file(sensors, code)) {
      const cv::FileStorage storage(sensors.string(), cv::FileStorage::READ);
      const cv::FileNode node = storage[kLorisCamera];
      const std::vector<double> v = MatrixOf(sensors, node["intrinsics"], 4);
      out.rig.left = Pinhole(v[0], v[2], v[1], v[3]);
      out.source = "sensors.yaml";
    }
    if (fs::is_regular_file(mount, code)) out.rig.T_body_left = LorisMount(mount);
  } catch (const cv::Exception&) {
    throw InputError(folder.string() + ": sensors.yaml or trans_matrix.yaml can't be read as YAML of OpenCV");
  }
  return out;
}

// What follows the stamp. It may have blanks and commas if such a file is there. Empty: no name.
std::string NameIn(const TextLine& line, const fs::path& folder) {
  if (line.words.size() < 2) return {};
  if (line.words.size() == 2) return line.words[1];
  constexpr const char* kBlank = " \t\r,";
  const std::size_t stamp = line.text.find(line.words[0]) + line.words[0].size();
  const std::size_t begin = line.text.find_first_not_of(kBlank, stamp);
  std::string name = line.text.substr(begin, line.text.find_last_not_of(kBlank) + 1 - begin);
  std::error_code code;
  return fs::exists(folder / name, code) ? name : std::string();
}

// `skipped`: lines that are of no use; may be null.
std::vector<StampedFile> ReadList(const fs::path& folder, const char* name, StampUnit& unit,
                                  std::vector<std::string>& warnings, std::size_t* skipped) {
  const fs::path list = folder / name;
  std::vector<StampedFile> files;
  StampOrder order(list, warnings);
  const std::vector<TextLine> lines = ReadListLines(list);
  const std::vector<double> stamps = StampsAt(list, lines, unit, warnings);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const TextLine& line = lines[i];
    const std::string file = NameIn(line, folder);
    if (file.empty())
      throw InputError(At(list, line.number) + "has " + std::to_string(line.words.size()) +
                       " columns; 2 are needed: time stamp [s] and file name");
    if (order.Accept(line.number, stamps[i])) files.push_back({stamps[i], folder / file});
  }
  if (skipped != nullptr) *skipped = order.skipped();
  if (files.empty())
    throw InputError(list.string() + ": lists no images; each line needs a time stamp and a file name");
  return files;
}

std::vector<double> StampsOf(const std::vector<StampedFile>& files) {
  std::vector<double> stamps;
  stamps.reserve(files.size());
  for (const StampedFile& file : files) stamps.push_back(file.stamp_s);
  return stamps;
}

// What the clocks of colour and depth say of frames. `depth`: the stamp of each one's depth image, NaN: none.
void SetClocks(std::vector<FrameFiles>& frames, const std::vector<double>& depth) {
  std::vector<double> stamps, own;
  stamps.reserve(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    stamps.push_back(frames[i].stamp_s);
    if (std::isfinite(depth[i]) && (own.empty() || depth[i] > own.back())) own.push_back(depth[i]);
  }
  const std::vector<double> clock = RegularTimes(stamps), depth_clock = RegularTimes(own);
  for (std::size_t i = 0, k = 0; i < frames.size(); ++i) {
    frames[i].clock_s = clock[i] - stamps[i];
    if (k < own.size() && own[k] == depth[i]) frames[i].depth_later_s = depth_clock[k++] - clock[i];
  }
}

void FromLists(const fs::path& folder, const TumLists& lists, const DatasetOptions& options,
               FolderContents& out) {
  const std::vector<StampedFile> colour =
      ReadList(folder, lists.colour, out.stamp_unit, out.warnings, &out.skipped);
  std::vector<int> match(colour.size(), -1);
  std::vector<StampedFile> depth;
  if (options.sensor == Sensor::kRgbd) {
    StampUnit unit = out.stamp_unit;
    depth = ReadList(folder, lists.depth, unit, out.warnings, nullptr);
    match = AssociateStamps(StampsOf(colour), StampsOf(depth), options.max_association_s);
  }
  std::size_t alone = 0;
  std::vector<double> depth_stamps(colour.size(), NAN);
  for (std::size_t i = 0; i < colour.size(); ++i) {
    FrameFiles frame;
    frame.stamp_s = colour[i].stamp_s;
    frame.image = colour[i].file;
    if (match[i] >= 0) {
      const StampedFile& partner = depth[static_cast<std::size_t>(match[i])];
      frame.depth = partner.file;
      depth_stamps[i] = partner.stamp_s;
    } else {
      ++alone;
    }
    out.frames.push_back(std::move(frame));
  }
  if (options.sensor != Sensor::kRgbd) return;
  SetClocks(out.frames, depth_stamps);
  const std::string limit = std::to_string(options.max_association_s) + " s";
  out.ReportAlone(folder / lists.depth, alone,
                  "no depth image is within " + limit + " of a colour image of " + lists.colour +
                      "; check the time stamps or raise max_association_s",
                  "colour images have no depth image within " + limit + " and are tracked with colour alone",
                  options);
}

// "stamp file stamp file". TUM puts colour first, ICL-NUIM depth: the folder's name tells.
void FromAssociations(const fs::path& folder, const DatasetOptions& options, FolderContents& out) {
  const fs::path list = folder / "associations.txt";
  const std::vector<TextLine> lines = ReadListLines(list);
  StampOrder order(list, out.warnings);
  for (const TextLine& line : lines) {
    if (line.words.size() != 4)
      throw InputError(At(list, line.number) + "has " + std::to_string(line.words.size()) +
                       " columns; 4 are needed: stamp, colour file, stamp, depth file");
  }
  const bool depth_first =
      !lines.empty() && (lines[0].words[1].rfind("depth", 0) == 0 || lines[0].words[3].rfind("rgb", 0) == 0);
  const std::size_t colour = depth_first ? 2 : 0;
  const std::vector<double> stamps = StampsAt(list, lines, out.stamp_unit, out.warnings, colour);
  bool counts = true;  // stamps are frame numbers that name the files (ICL-NUIM), not times
  std::vector<std::string> names;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const TextLine& line = lines[i];
    FrameFiles frame;
    frame.stamp_s = stamps[i];
    NumberAt(list, line, 2 - colour);
    frame.image = folder / line.words[colour + 1];
    if (options.sensor == Sensor::kRgbd) frame.depth = folder / line.words[3 - colour];
    names.push_back(frame.image.stem().string());
    counts = counts && line.words[colour] == names.back() && names.back().find('.') == std::string::npos;
    if (order.Accept(line.number, frame.stamp_s)) out.frames.push_back(std::move(frame));
  }
  out.skipped = order.skipped();
  if (counts && out.frames.size() > 1 && internal::FindStamps(names).stamps.empty()) {
    out.stamp_scale = 1.0 / (options.rate_hz > 0 ? options.rate_hz : 30.0);
    for (FrameFiles& frame : out.frames) frame.stamp_s *= out.stamp_scale;
    out.warnings.push_back(list.string() + ": its time stamps are frame numbers; " +
                           std::to_string(1.0 / out.stamp_scale) + " frames a second are assumed (rate_hz)");
  }
}

}  // namespace

TumLists TumListsOf(const fs::path& folder) {
  std::error_code code;
  const auto is = [&](const char* name) { return fs::exists(folder / name, code); };
  if (is("rgb.txt") || !is("color.txt")) return {};
  return {"color.txt", is("aligned_depth.txt") ? "aligned_depth.txt" : "depth.txt"};
}

LayoutCalibration ReadTumCalibration(const fs::path& folder) {
  std::error_code code;
  LayoutCalibration out;
  const fs::path eth3d = folder / "calibration.txt";
  if (std::string(TumListsOf(folder).colour) == "color.txt") {
    out = ReadLoris(folder);
    out.depth_units_per_m = 1000;
  } else if (fs::is_regular_file(eth3d, code)) {  // https://www.eth3d.net/slam_documentation
    out.rig.left = ReadIntrinsics(eth3d);
    out.source = "calibration.txt";
    out.depth_units_per_m = 5000;
  }
  return out;
}

std::vector<int> AssociateStamps(const std::vector<double>& a, const std::vector<double>& b, double limit_s) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (auto it = std::lower_bound(b.begin(), b.end(), a[i] - limit_s);
         it != b.end() && *it <= a[i] + limit_s; ++it)
      pairs.emplace_back(std::abs(*it - a[i]), i, static_cast<std::size_t>(it - b.begin()));
  }
  std::sort(pairs.begin(), pairs.end());
  std::vector<int> match(a.size(), -1);
  std::vector<bool> used(b.size(), false);
  for (const auto& [difference, i, j] : pairs) {
    if (match[i] >= 0 || used[j]) continue;
    match[i] = static_cast<int>(j);
    used[j] = true;
  }
  return match;
}

FolderContents FindTum(const fs::path& folder, const DatasetOptions& options) {
  if (options.sensor == Sensor::kStereo)
    throw InputError(folder.string() + ": the TUM layout has no stereo pairs; set sensor to rgbd or mono");
  FolderContents out;
  out.folder = folder;
  std::error_code code;
  const TumLists names = TumListsOf(folder);
  const bool lists = fs::exists(folder / names.colour, code);
  const bool depth_list = fs::exists(folder / names.depth, code);
  const bool associations = fs::exists(folder / "associations.txt", code);
  if (options.sensor == Sensor::kRgbd ? associations : !lists) {
    FromAssociations(folder, options, out);
  } else if (options.sensor == Sensor::kRgbd && !(lists && depth_list)) {
    throw InputError(
        (folder / (lists ? names.depth : names.colour)).string() +
        ": is missing; RGB-D needs rgb.txt and depth.txt (stamp and file name a line), or associations.txt");
  } else {
    FromLists(folder, names, options, out);
  }
  const LayoutCalibration own = ReadTumCalibration(folder);
  if (!options.camera && !own.rig.left)
    throw InputError(folder.string() +
                     ": the TUM layout holds no calibration; set fx, fy, cx, cy under 'camera:' in the "
                     "configuration (tum_fr1_rgbd and its like, which are part of tutti, have them)");
  out.rig.left = options.camera ? options.camera : own.rig.left;
  out.rig.T_body_left = own.rig.T_body_left;
  out.depth.units_per_m = own.depth_units_per_m;
  out.rate_hz = 30.0;
  out.MeasureRate();
  out.truth_places = {folder / "groundtruth.txt", folder / "poses.txt"};
  for (int i = 0; i < 4; ++i) {  // ICL-NUIM's names
    out.truth_places.push_back(folder / ("livingRoom" + std::to_string(i) + ".gt.freiburg"));
    out.truth_places.push_back(folder / ("traj" + std::to_string(i) + ".gt.freiburg"));
  }
  return out;
}

}  // namespace tutti
