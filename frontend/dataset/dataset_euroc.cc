// EuRoC ASL: mav0/cam0, mav0/cam1 with sensor.yaml and data.csv.
#include <algorithm>
#include <cmath>

#include "core/camera_text.h"
#include "core/time_stamps.h"
#include "frontend/dataset/dataset_folder.h"
#include "frontend/dataset/imu_file.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

// Keys of sensor.yaml, a small, fixed subset of YAML that is read with the line numbers that errors need: the
// line of each, and the words of its value without brackets.
using YamlValues = std::map<std::string, TextLine>;

// "key: word" and "key: [a, b, ...]" over any number of lines. Nested keys (T_BS: data:) count by their own
// name: no two of those that are used are equal.
YamlValues ReadValues(const fs::path& file) {
  YamlValues values;
  TextLine* open = nullptr;  // a list whose bracket is not closed yet
  for (TextLine line : ReadTextLines(file)) {
    std::size_t first = 0;
    if (open == nullptr) {
      std::string key = line.words[0];
      if (key.size() < 2 || key.back() != ':') continue;  // %YAML:1.0, ---
      key.pop_back();
      open = &values[key];
      open->number = line.number;
      first = 1;
    }
    bool more = false;
    for (std::size_t i = first; i < line.words.size(); ++i) {
      std::string word = line.words[i];
      if (word.find('[') != std::string::npos) more = true;
      if (word.find(']') != std::string::npos) more = false;
      word.erase(std::remove_if(word.begin(), word.end(), [](char c) { return c == '[' || c == ']'; }),
                 word.end());
      if (!word.empty()) open->words.push_back(word);
    }
    const bool closed = line.words.back().find(']') != std::string::npos;
    if (!more && (first == 1 || closed)) open = nullptr;
  }
  return values;
}

const TextLine& Get(const fs::path& file, const YamlValues& values, const std::string& key,
                    std::size_t size) {
  const auto found = values.find(key);
  if (found == values.end()) throw InputError(file.string() + ": has no key '" + key + "'");
  const TextLine& line = found->second;
  if (line.words.size() != size)
    throw InputError(At(file, line.number) + "'" + key + "' has " + std::to_string(line.words.size()) +
                     " values; " + std::to_string(size) + " are needed");
  return line;
}

std::vector<double> NumbersAt(const fs::path& file, const TextLine& line) {
  std::vector<double> numbers;
  for (std::size_t i = 0; i < line.words.size(); ++i) numbers.push_back(NumberAt(file, line, i));
  return numbers;
}

Pose ReadTransform(const fs::path& file, const TextLine& transform) {
  Eigen::Matrix<double, 3, 4> matrix;
  for (int i = 0; i < 12; ++i) matrix(i / 4, i % 4) = NumberAt(file, transform, static_cast<std::size_t>(i));
  if (!(std::abs(matrix.leftCols<3>().determinant() - 1.0) <= 0.01))  // also if it is not finite
    throw InputError(At(file, transform.number) +
                     "T_BS is not a rigid transform (its rotation has a determinant other than 1)");
  return Pose::FromMatrix(matrix);
}

struct StampedImage {
  std::int64_t stamp_ns = 0;
  double stamp_s = 0;
  fs::path file;
};

// `skipped`: lines that are of no use; may be null.
std::vector<StampedImage> ReadCsv(const fs::path& camera, StampUnit& unit, std::vector<std::string>& warnings,
                                  std::size_t* skipped) {
  const fs::path csv = camera / "data.csv";
  std::vector<StampedImage> images;
  StampOrder order(csv, warnings);
  const std::vector<TextLine> lines = ReadListLines(csv);
  const std::vector<double> stamps = StampsAt(csv, lines, unit, warnings);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const TextLine& line = lines[i];
    if (line.words.size() != 2)
      throw InputError(At(csv, line.number) + "has " + std::to_string(line.words.size()) +
                       " columns; 2 are needed: time stamp [ns], file name");
    const std::optional<std::int64_t> stamp_ns = internal::NanosecondsOf(line.words[0], unit);
    if (!stamp_ns)
      throw InputError(At(csv, line.number) + "'" + line.words[0] +
                       "' is no time stamp that fits into nanoseconds; repair the line");
    if (order.Accept(line.number, stamps[i]))
      images.push_back({*stamp_ns, stamps[i], camera / "data" / line.words[1]});
  }
  if (skipped != nullptr) *skipped = order.skipped();
  if (images.empty()) throw InputError(csv.string() + ": lists no images");
  return images;
}

SensorYaml ReadMounted(const fs::path& file) {
  const SensorYaml read = ReadSensorYaml(file);
  if (!read.T_body_sensor)
    throw InputError(file.string() + ": has no key 'data' (T_BS: where the camera is on the body)");
  return read;
}

// Cameras that one clock triggers have equal stamps; other rigs differ by less than a millisecond or two.
constexpr std::int64_t kSamePairNs = 2'500'000;

}  // namespace

SensorYaml ReadSensorYaml(const fs::path& file) {
  const YamlValues values = ReadValues(file);
  const auto get = [&](const char* key, std::size_t size) -> const TextLine& {
    return Get(file, values, key, size);
  };
  SensorYaml out;
  if (values.count("data") != 0) out.T_body_sensor = ReadTransform(file, get("data", 16));
  if (values.count("camera_model") != 0) {
    const TextLine& model = get("camera_model", 1);
    if (model.words[0] != "pinhole")
      throw InputError(At(file, model.number) + "camera_model '" + model.words[0] +
                       "': tutti has pinhole alone");
  }
  const std::vector<double> k = NumbersAt(file, get("intrinsics", 4));
  const std::vector<double> size = NumbersAt(file, get("resolution", 2));
  PinholeCamera& c = out.camera;
  c = Pinhole(k[0], k[1], k[2], k[3], {internal::PixelsOf(size[0]), internal::PixelsOf(size[1])});
  const TextLine& model = get("distortion_model", 1);
  std::vector<double> lens;
  if (const auto found = values.find("distortion_coefficients"); found != values.end())
    lens = NumbersAt(file, found->second);
  else if (model.words[0] != "none")
    get("distortion_coefficients", 4);
  const std::string wrong = internal::SetLens(model.words[0], lens, c);
  if (!wrong.empty()) throw InputError(At(file, model.number) + wrong);
  if (values.count("rate_hz") != 0) out.rate_hz = NumberAt(file, get("rate_hz", 1), 0);
  const std::string problem = c.Validate();
  if (!problem.empty()) throw InputError(file.string() + ": " + problem);
  return out;
}

void ReadImuYaml(const fs::path& file, ImuBeside* imu) {
  const YamlValues values = ReadValues(file);
  if (values.count("data") != 0) imu->T_body_imu = ReadTransform(file, Get(file, values, "data", 16));
  const auto read = [&](const char* key, double* value) {
    if (values.count(key) != 0) *value = NumberAt(file, Get(file, values, key, 1), 0);
  };
  read("gyroscope_noise_density", &imu->calibration.gyro_noise);
  read("gyroscope_random_walk", &imu->calibration.gyro_random_walk);
  read("accelerometer_noise_density", &imu->calibration.acceleration_noise);
  read("accelerometer_random_walk", &imu->calibration.acceleration_random_walk);
}

FolderContents FindEuroc(const fs::path& folder, const DatasetOptions& options) {
  std::error_code code;
  const fs::path mav = fs::is_directory(folder / "cam0", code) ? folder : folder / "mav0";
  const bool rgbd = options.sensor == Sensor::kRgbd;
  const fs::path beside = mav / (rgbd ? "depth0" : "cam1");
  if (rgbd && !fs::is_directory(beside, code))
    throw InputError(
        folder.string() +
        ": EuRoC's layout has no depth images (mav0/depth0, of tutti generate, is not there); set "
        "sensor to stereo or mono");
  FolderContents out;
  out.folder = folder;
  const SensorYaml left = ReadMounted(mav / "cam0" / "sensor.yaml");
  out.rig.left = options.camera ? *options.camera : left.camera;
  out.rig.T_body_left = *left.T_body_sensor;
  out.rate_hz = left.rate_hz.value_or(20);
  out.stamp_unit = StampUnit::kNanoseconds;
  const std::vector<StampedImage> images = ReadCsv(mav / "cam0", out.stamp_unit, out.warnings, &out.skipped);
  std::vector<StampedImage> right_images;
  if (options.sensor == Sensor::kStereo) {
    const SensorYaml right = ReadMounted(beside / "sensor.yaml");
    out.rig.right = right.camera;
    out.rig.T_right_left = right.T_body_sensor->Inverse() * *left.T_body_sensor;
  }
  if (options.sensor != Sensor::kMono) {
    StampUnit unit = out.stamp_unit;
    right_images = ReadCsv(beside, unit, out.warnings, nullptr);
  }
  std::size_t alone = 0;
  for (const StampedImage& image : images) {
    FrameFiles frame;
    frame.stamp_s = image.stamp_s;
    frame.image = image.file;
    const auto at = std::lower_bound(right_images.begin(), right_images.end(), image.stamp_ns - kSamePairNs,
                                     [](const StampedImage& r, std::int64_t ns) { return r.stamp_ns < ns; });
    if (at == right_images.end() || at->stamp_ns > image.stamp_ns + kSamePairNs)
      ++alone;
    else
      (rgbd ? frame.depth : frame.right) = at->file;
    out.frames.push_back(std::move(frame));
  }
  if (options.sensor != Sensor::kMono)
    out.ReportAlone(beside / "data.csv", alone, "no image has the time stamp of an image of cam0",
                    rgbd ? "images have no depth image and are tracked without"
                         : "left images have no right image and are tracked without",
                    options);
  out.truth_places = {folder / "groundtruth_tum.txt", folder / "groundtruth.txt",
                      mav / "state_groundtruth_estimate0" / "data.csv",
                      mav.parent_path() / "groundtruth_tum.txt"};
  return out;
}

}  // namespace tutti
