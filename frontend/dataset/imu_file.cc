#include "frontend/dataset/imu_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>

#include "core/numbers.h"
#include "core/text_reader.h"
#include "core/time_stamps.h"
#include "frontend/dataset/bag.h"
#include "frontend/dataset/dataset_folder.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {

namespace fs = std::filesystem;

namespace {

constexpr const char* kImuMessage = "sensor_msgs/Imu";

std::optional<ImuBeside> FindTopics(const fs::path& file, const std::string& topic) {
  ImuBeside found;
  found.file = file;
  const std::unique_ptr<Bag> bag = Bag::Open(file);
  for (const Bag::Topic& each : bag->topics()) {
    if (each.type == kImuMessage && (topic.empty() || each.name == topic)) found.topics.push_back(each.name);
  }
  if (!found.topics.empty()) return found;
  if (topic.empty()) return std::nullopt;
  throw InputError(file.string() + ": has no measurements of '" + topic + "' (dataset.imu_topic)");
}

std::vector<ImuSample> ReadTopic(const Bag& bag, const std::string& topic) {
  std::vector<ImuSample> samples;
  for (const BagMessage& message : bag.Messages(topic)) {
    try {
      const std::string bytes = bag.Read(message);
      ImuSample sample = DecodeImuMessage(bytes, bag.Find(topic)->serialization, topic);
      MessageHead head = {};
      std::memcpy(head.data(), bytes.data(), sizeof head);
      sample.stamp_s = StampOf(head);
      samples.push_back(sample);
    } catch (const InputError&) {  // how many are missing, the rate tells
    }
  }
  std::stable_sort(samples.begin(), samples.end(),
                   [](const ImuSample& a, const ImuSample& b) { return a.stamp_s < b.stamp_s; });
  return samples;
}

// Those of `from`, between two measurements by their line; measurements outside of it go.
void TakeAccelerations(const std::vector<ImuSample>& from, std::vector<ImuSample>* samples) {
  const auto earlier = [](const ImuSample& a, double stamp_s) { return a.stamp_s < stamp_s; };
  std::vector<ImuSample> kept;
  for (ImuSample sample : *samples) {
    const auto after = std::lower_bound(from.begin(), from.end(), sample.stamp_s, earlier);
    if (after == from.end() || (after == from.begin() && after->stamp_s != sample.stamp_s)) continue;
    const auto before = after == from.begin() ? after : after - 1;
    const double dt = after->stamp_s - before->stamp_s;
    const double share = dt > 0 ? (sample.stamp_s - before->stamp_s) / dt : 0;
    sample.acceleration = before->acceleration + share * (after->acceleration - before->acceleration);
    kept.push_back(sample);
  }
  *samples = std::move(kept);
}

}  // namespace

std::vector<ImuSample> ReadImuFile(const fs::path& file) {
  const std::vector<TextLine> lines = ReadListLines(file);
  StampUnit unit = StampUnit::kNanoseconds;
  std::vector<std::string> notes;
  const std::vector<double> stamps = StampsAt(file, lines, unit, notes);
  std::vector<ImuSample> samples;
  samples.reserve(lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i].words.size() < 7)
      throw InputError(
          At(file, lines[i].number) + "has " + std::to_string(lines[i].words.size()) +
          " columns; an IMU needs 7: time stamp, angular velocity x, y, z, acceleration x, y, z");
    ImuSample sample;
    sample.stamp_s = stamps[i];
    std::size_t column = 1;
    for (double& value : sample.gyro) value = NumberAt(file, lines[i], column++);
    for (double& value : sample.acceleration) value = NumberAt(file, lines[i], column++);
    samples.push_back(sample);
  }
  if (samples.size() < 2) throw InputError(file.string() + ": holds no measurements of an IMU");
  return samples;
}

std::vector<ImuSample> ReadImu(const ImuBeside& imu) {
  if (imu.topics.empty()) return ReadImuFile(imu.file);
  const std::unique_ptr<Bag> bag = Bag::Open(imu.file);
  if (imu.topics.size() == 1) return ReadTopic(*bag, imu.topics.front());
  const auto with = [&](const char* part) {
    return std::find_if(imu.topics.begin(), imu.topics.end(),
                        [&](const std::string& topic) { return topic.find(part) != std::string::npos; });
  };
  const auto gyro = with("gyro"), accel = with("accel");
  if (imu.topics.size() > 2 || gyro == imu.topics.end() || accel == imu.topics.end())
    throw InputError(imu.file.string() +
                     ": which IMU? Set dataset.imu_topic to one of: " + JoinText(imu.topics, " "));
  std::vector<ImuSample> samples = ReadTopic(*bag, *gyro);
  TakeAccelerations(ReadTopic(*bag, *accel), &samples);
  return samples;
}

std::optional<ImuBeside> FindImu(const fs::path& dataset, const std::string& topic) {
  std::error_code code;
  const bool is_bag = fs::is_directory(dataset, code) ? !Bag::Files(dataset).empty() : Bag::IsNamed(dataset);
  if (is_bag) return FindTopics(dataset, topic);
  for (const char* name : {"mav0/imu0/data.csv", "imu0/data.csv", "imu.csv", "imu.txt"}) {
    if (!fs::is_regular_file(dataset / name, code)) continue;
    ImuBeside found;
    found.file = dataset / name;
    const fs::path yaml = found.file.parent_path() / "sensor.yaml";
    if (found.file.filename() == "data.csv" && fs::is_regular_file(yaml, code)) ReadImuYaml(yaml, &found);
    return found;
  }
  return std::nullopt;
}

}  // namespace tutti
