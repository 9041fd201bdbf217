// TUM RGB-D: rgb.txt, depth.txt, groundtruth.txt; or associations.txt (TUM's and ICL-NUIM's).
#include <algorithm>
#include <cmath>
#include <tuple>

#include "core/example_configs.h"
#include "core/time_stamps.h"
#include "frontend/dataset/dataset_folder.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

struct StampedFile {
  double stamp_s = 0;
  std::filesystem::path file;
};

// What follows the stamp. It may have blanks and commas if such a file is there. Empty: no name.
std::string NameIn(const TextLine& line, const std::filesystem::path& folder) {
  if (line.words.size() < 2) return {};
  if (line.words.size() == 2) return line.words[1];
  constexpr const char* kBlank = " \t\r,";
  const std::size_t stamp = line.text.find(line.words[0]) + line.words[0].size();
  const std::size_t begin = line.text.find_first_not_of(kBlank, stamp);
  std::string name = line.text.substr(begin, line.text.find_last_not_of(kBlank) + 1 - begin);
  std::error_code code;
  return std::filesystem::exists(folder / name, code) ? name : std::string();
}

std::vector<StampedFile> ReadList(const std::filesystem::path& folder, const char* name, StampUnit& unit,
                                  std::vector<std::string>& warnings) {
  const std::filesystem::path list = folder / name;
  std::vector<StampedFile> files;
  StampOrder order(list, warnings);
  const std::vector<TextLine> lines = ReadListLines(list);
  const std::vector<double> stamps = StampsAt(list, lines, unit, warnings);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const TextLine& line = lines[i];
    const double stamp = stamps[i];
    const std::string name_in_list = NameIn(line, folder);
    if (name_in_list.empty()) {
      throw InputError(At(list, line.number) + "has " + std::to_string(line.words.size()) +
                       " columns; 2 are needed: time stamp [s] and file name");
    }
    if (order.Accept(line.number, stamp)) files.push_back({stamp, folder / name_in_list});
  }
  if (files.empty())
    throw InputError(list.string() + ": lists no images; each line needs a time stamp and a file name");
  return files;
}

// Index of the depth image of each colour image, or -1: pairs with the smallest difference first, each image
// once (as the data set's own associate.py).
std::vector<int> Associate(const std::vector<StampedFile>& colour, const std::vector<StampedFile>& depth,
                           double limit_s) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < colour.size(); ++i) {
    const auto first = std::lower_bound(depth.begin(), depth.end(), colour[i].stamp_s - limit_s,
                                        [](const StampedFile& f, double stamp) { return f.stamp_s < stamp; });
    for (auto it = first; it != depth.end() && it->stamp_s <= colour[i].stamp_s + limit_s; ++it) {
      pairs.emplace_back(std::abs(it->stamp_s - colour[i].stamp_s), i,
                         static_cast<std::size_t>(it - depth.begin()));
    }
  }
  std::sort(pairs.begin(), pairs.end());
  std::vector<int> match(colour.size(), -1);
  std::vector<bool> used(depth.size(), false);
  for (const auto& [difference, i, j] : pairs) {
    if (match[i] >= 0 || used[j]) continue;
    match[i] = static_cast<int>(j);
    used[j] = true;
  }
  return match;
}

void FromLists(const std::filesystem::path& folder, const DatasetOptions& options, FolderContents& out) {
  const std::vector<StampedFile> colour = ReadList(folder, "rgb.txt", out.stamp_unit, out.warnings);
  std::vector<int> match(colour.size(), -1);
  std::vector<StampedFile> depth;
  if (options.sensor == Sensor::kRgbd) {
    StampUnit unit = out.stamp_unit;
    depth = ReadList(folder, "depth.txt", unit, out.warnings);
    match = Associate(colour, depth, options.max_association_s);
  }
  std::size_t alone = 0;
  for (std::size_t i = 0; i < colour.size(); ++i) {
    FrameFiles frame;
    frame.stamp_s = colour[i].stamp_s;
    frame.image = colour[i].file;
    if (match[i] >= 0)
      frame.depth = depth[static_cast<std::size_t>(match[i])].file;
    else
      ++alone;
    out.frames.push_back(std::move(frame));
  }
  if (options.sensor != Sensor::kRgbd) return;
  if (alone == colour.size()) {
    throw InputError((folder / "depth.txt").string() + ": no depth image is within " +
                     std::to_string(options.max_association_s) +
                     " s of a colour image of rgb.txt; check the time stamps or raise max_association_s");
  }
  WarnOfFramesWithoutDepth(folder / "depth.txt", alone,
                           "colour images have no depth image within " +
                               std::to_string(options.max_association_s) +
                               " s and are tracked with colour alone",
                           options, &out);
}

// "stamp file stamp file". TUM puts colour first, ICL-NUIM depth: the folder's name tells.
void FromAssociations(const std::filesystem::path& folder, const DatasetOptions& options,
                      FolderContents& out) {
  const std::filesystem::path list = folder / "associations.txt";
  const std::vector<TextLine> lines = ReadListLines(list);
  StampOrder order(list, out.warnings);
  for (const TextLine& line : lines) {
    if (line.words.size() != 4) {
      throw InputError(At(list, line.number) + "has " + std::to_string(line.words.size()) +
                       " columns; 4 are needed: stamp, colour file, stamp, depth file");
    }
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
  if (counts && out.frames.size() > 1 && internal::FindStamps(names).stamps.empty()) {
    out.stamp_scale = 1.0 / (options.rate_hz > 0 ? options.rate_hz : 30.0);
    for (FrameFiles& frame : out.frames) frame.stamp_s *= out.stamp_scale;
    out.warnings.push_back(list.string() + ": its time stamps are frame numbers; " +
                           std::to_string(1.0 / out.stamp_scale) + " frames a second are assumed (rate_hz)");
  }
}

}  // namespace

FolderContents FindTum(const std::filesystem::path& folder, const DatasetOptions& options) {
  if (options.sensor == Sensor::kStereo) {
    throw InputError(folder.string() + ": the TUM layout has no stereo pairs; set sensor to rgbd or mono");
  }
  FolderContents out;
  out.folder = folder;
  std::error_code code;
  const bool lists = std::filesystem::exists(folder / "rgb.txt", code);
  const bool depth_list = std::filesystem::exists(folder / "depth.txt", code);
  const bool associations = std::filesystem::exists(folder / "associations.txt", code);
  if (options.sensor == Sensor::kRgbd ? associations : !lists) {
    FromAssociations(folder, options, out);
  } else if (options.sensor == Sensor::kRgbd && !(lists && depth_list)) {
    throw InputError(
        (folder / (lists ? "depth.txt" : "rgb.txt")).string() +
        ": is missing; RGB-D needs rgb.txt and depth.txt (stamp and file name a line), or associations.txt");
  } else {
    FromLists(folder, options, out);
  }
  if (!options.camera) {
    throw InputError(folder.string() +
                     ": the TUM layout holds no calibration; set fx, fy, cx, cy under 'camera:' in the "
                     "configuration (" +
                     internal::ExampleConfigs() + "/tum_fr1_rgbd.yaml and its like have them)");
  }
  out.left = options.camera;
  out.rate_hz = 30.0;
  if (out.frames.size() > 1) {
    out.rate_hz =
        static_cast<double>(out.frames.size() - 1) / (out.frames.back().stamp_s - out.frames.front().stamp_s);
  }
  out.truth_places = {folder / "groundtruth.txt", folder / "poses.txt"};
  for (int i = 0; i < 4; ++i) {  // ICL-NUIM's names
    out.truth_places.push_back(folder / ("livingRoom" + std::to_string(i) + ".gt.freiburg"));
    out.truth_places.push_back(folder / ("traj" + std::to_string(i) + ".gt.freiburg"));
  }
  return out;
}

}  // namespace tutti
