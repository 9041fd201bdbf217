// EuRoC ASL: mav0/cam0, mav0/cam1 with sensor.yaml and data.csv.
#include <algorithm>

#include "core/time_stamps.h"
#include "frontend/dataset/dataset_folder.h"
#include "frontend/dataset/sensor_yaml.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

struct StampedImage {
  std::int64_t stamp_ns = 0;
  double stamp_s = 0;
  std::filesystem::path file;
};

// `skipped`: lines that are of no use; may be null.
std::vector<StampedImage> ReadCsv(const std::filesystem::path& camera, StampUnit& unit,
                                  std::vector<std::string>& warnings, std::size_t* skipped) {
  const std::filesystem::path csv = camera / "data.csv";
  std::vector<StampedImage> images;
  StampOrder order(csv, warnings);
  const std::vector<TextLine> lines = ReadListLines(csv);
  const std::vector<double> stamps = StampsAt(csv, lines, unit, warnings);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const TextLine& line = lines[i];
    if (line.words.size() != 2) {
      throw InputError(At(csv, line.number) + "has " + std::to_string(line.words.size()) +
                       " columns; 2 are needed: time stamp [ns], file name");
    }
    const std::optional<std::int64_t> stamp_ns = internal::NanosecondsOf(line.words[0], unit);
    if (!stamp_ns) {
      throw InputError(At(csv, line.number) + "'" + line.words[0] +
                       "' is no time stamp that fits into nanoseconds; repair the line");
    }
    if (!order.Accept(line.number, stamps[i])) continue;
    images.push_back({*stamp_ns, stamps[i], camera / "data" / line.words[1]});
  }
  if (skipped != nullptr) *skipped = order.skipped();
  if (images.empty()) throw InputError(csv.string() + ": lists no images");
  return images;
}

struct MountedCamera {
  PinholeCamera camera;
  Pose T_body_camera;
  double rate_hz = 20;
};

MountedCamera ReadMounted(const std::filesystem::path& file) {
  const SensorYaml read = ReadSensorYaml(file);
  if (!read.T_body_sensor)
    throw InputError(file.string() + ": has no key 'data' (T_BS: where the camera is on the body)");
  return {read.camera, *read.T_body_sensor, read.rate_hz.value_or(MountedCamera().rate_hz)};
}

// Cameras that one clock triggers have equal stamps; other rigs differ by less than a millisecond or two.
constexpr std::int64_t kSamePairNs = 2'500'000;

}  // namespace

FolderContents FindEuroc(const std::filesystem::path& folder, const DatasetOptions& options) {
  if (options.sensor == Sensor::kRgbd) {
    throw InputError(folder.string() +
                     ": the EuRoC layout has no depth images; set sensor to stereo or mono");
  }
  std::error_code code;
  const bool inside = std::filesystem::is_directory(folder / "cam0", code);
  const std::filesystem::path mav = inside ? folder : folder / "mav0";
  FolderContents out;
  out.folder = folder;
  const MountedCamera left = ReadMounted(mav / "cam0" / "sensor.yaml");
  out.left = options.camera ? *options.camera : left.camera;
  out.T_body_left = left.T_body_camera;
  out.rate_hz = left.rate_hz;
  out.stamp_unit = StampUnit::kNanoseconds;
  const std::vector<StampedImage> images = ReadCsv(mav / "cam0", out.stamp_unit, out.warnings, &out.skipped);
  std::vector<StampedImage> right_images;
  if (options.sensor == Sensor::kStereo) {
    const MountedCamera right = ReadMounted(mav / "cam1" / "sensor.yaml");
    out.right = right.camera;
    out.T_right_left = right.T_body_camera.Inverse() * left.T_body_camera;
    StampUnit unit = out.stamp_unit;
    right_images = ReadCsv(mav / "cam1", unit, out.warnings, nullptr);
  }
  std::size_t alone = 0;
  for (const StampedImage& image : images) {
    FrameFiles frame;
    frame.stamp_s = image.stamp_s;
    frame.image = image.file;
    if (options.sensor == Sensor::kStereo) {
      const auto at =
          std::lower_bound(right_images.begin(), right_images.end(), image.stamp_ns - kSamePairNs,
                           [](const StampedImage& r, std::int64_t ns) { return r.stamp_ns < ns; });
      if (at == right_images.end() || at->stamp_ns > image.stamp_ns + kSamePairNs)
        ++alone;
      else
        frame.right = at->file;
    }
    out.frames.push_back(std::move(frame));
  }
  const std::filesystem::path right_list = mav / "cam1" / "data.csv";
  if (alone == images.size())
    throw InputError(right_list.string() + ": no image has the time stamp of an image of cam0");
  WarnOfFramesWithoutDepth(right_list, alone, "left images have no right image and are tracked without",
                           options, &out);
  out.truth_places = {folder / "groundtruth_tum.txt", folder / "groundtruth.txt",
                      mav / "state_groundtruth_estimate0" / "data.csv",
                      mav.parent_path() / "groundtruth_tum.txt"};
  return out;
}

}  // namespace tutti
