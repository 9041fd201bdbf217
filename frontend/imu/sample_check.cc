#include "frontend/imu/imu_examination.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <utility>

#include "core/numbers.h"

namespace tutti {
namespace {

constexpr double kMostMissing = 0.05, kLeastHz = 50, kStuck_s = 0.5;
constexpr double kGravity = 9.81, kGravityOff = 0.15;  // of it, in the median
constexpr double kLeastCovered = 0.5;

bool SameValues(const ImuSample& a, const ImuSample& b) {
  return a.gyro == b.gyro && a.acceleration == b.acceleration;
}

// The longest time that the values did not change.
double LongestStuck(const std::vector<ImuSample>& samples) {
  double longest = 0;
  for (std::size_t i = 1, first = 0; i < samples.size(); ++i) {
    if (!SameValues(samples[i], samples[first])) first = i;
    longest = std::max(longest, samples[i].stamp_s - samples[first].stamp_s);
  }
  return longest;
}

void CheckTimes(const std::vector<ImuSample>& samples, ImuReport* report) {
  std::vector<double> intervals;
  std::size_t back = 0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const double dt = samples[i].stamp_s - samples[i - 1].stamp_s;
    if (dt > 0)
      intervals.push_back(dt);
    else
      ++back;
  }
  if (back > 0)
    report->findings.push_back(
        {FormattedText("%zu time stamps repeat the one before or go back in time", back),
         "sort the measurements by time, or cut the file there if it is two recordings"});
  if (intervals.empty()) return;
  const double interval = internal::Median(intervals);
  report->rate_hz = 1 / interval;
  report->longest_gap_s = *std::max_element(intervals.begin(), intervals.end());
  report->duration_s = samples.back().stamp_s - samples.front().stamp_s;
  report->missing_share =
      std::max(0.0, 1 - static_cast<double>(intervals.size()) * interval / report->duration_s);
  if (report->missing_share > kMostMissing)
    report->findings.push_back(
        {FormattedText("%.0f %% of the measurements are missing (rate %.0f Hz, longest gap %.2f s)",
                       100 * report->missing_share, report->rate_hz, report->longest_gap_s),
         "record without dropping any: a larger queue, or a disk and a bus that keep up"});
  if (report->rate_hz < kLeastHz)
    report->findings.push_back(
        {FormattedText("it measures %.0f times a second", report->rate_hz), "set it to 100 Hz or more"});
}

void CheckAccelerations(const std::vector<ImuSample>& samples, ImuReport* report) {
  std::vector<double> lengths;
  lengths.reserve(samples.size());
  for (const ImuSample& s : samples) lengths.push_back(s.acceleration.norm());
  const double median = internal::Median(lengths);
  report->acceleration_mps2 = median;
  if (std::abs(median - kGravity) < kGravityOff * kGravity) return;
  std::sort(lengths.begin(), lengths.end());
  const double low = lengths[lengths.size() / 10];
  const auto is = [&](double g) { return std::abs(median - g) < kGravityOff * g && low > 0.6 * g; };
  const std::string length = FormattedText("the accelerations' median length is %.3g", median);
  if (is(1) || is(1000)) {
    report->findings.push_back(
        {length + (is(1) ? ", which is gravity in g" : ", which is gravity in mg"),
         FormattedText("multiply them by %.5g: they must be in m/s^2", is(1) ? 9.80665 : 0.00980665)});
  } else if (median < 0.5 * kGravity) {
    report->findings.push_back({length + " m/s^2: gravity was taken out",
                                "record the accelerations as measured, with gravity, not the linear ones"});
  } else {
    report->findings.push_back(
        {length + ", not 9.8 m/s^2", "look up the sensor's unit and range, and convert to m/s^2"});
  }
}

// The longest part at rest, as [first, end): half seconds whose values scatter and whose means differ no more
// than noise and a draught do.
std::pair<std::size_t, std::size_t> LongestRest(const std::vector<ImuSample>& samples, std::size_t chunk) {
  constexpr double kGyro = 0.02, kAcceleration = 0.2;  // [rad/s], [m/s^2]
  using Six = Eigen::Matrix<double, 6, 1>;
  const Six most =
      (Six() << Eigen::Vector3d::Constant(kGyro), Eigen::Vector3d::Constant(kAcceleration)).finished();
  std::pair<std::size_t, std::size_t> longest(0, 0);
  Six before = Six::Zero();
  for (std::size_t first = 0, at = 0; at + chunk <= samples.size(); at += chunk) {
    Six sum = Six::Zero(), squares = Six::Zero();
    for (std::size_t i = at; i < at + chunk; ++i) {
      const Six value = (Six() << samples[i].gyro, samples[i].acceleration).finished();
      sum += value;
      squares += value.cwiseAbs2();
    }
    const Six mean = sum / static_cast<double>(chunk);
    const Six variance = squares / static_cast<double>(chunk) - mean.cwiseAbs2();
    const bool still = (variance.array() <= most.array().square()).all();
    if (!still)
      first = at + chunk;
    else if (at > first && !((mean - before).cwiseAbs().array() <= 0.5 * most.array()).all())
      first = at;
    before = mean;
    if (at + chunk > first && at + chunk - first > longest.second - longest.first)
      longest = {first, at + chunk};
  }
  return longest;
}

// Allan deviation of the worst of three axes for means over `length` samples, overlapping.
double AllanDeviation(const std::vector<Eigen::Vector3d>& sums, std::size_t length) {
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  std::size_t count = 0;
  for (std::size_t i = 0; i + 2 * length < sums.size(); ++i, ++count)
    squares += (sums[i + 2 * length] - 2 * sums[i + length] + sums[i]).cwiseAbs2();
  return std::sqrt(0.5 * squares.maxCoeff() / static_cast<double>(std::max<std::size_t>(1, count))) /
         static_cast<double>(length);
}

std::optional<ImuNoise> NoiseAtRest(const std::vector<ImuSample>& samples, double rate_hz) {
  constexpr double kLeast_s = 10, kChunk_s = 0.5;
  const auto chunk = static_cast<std::size_t>(std::lround(kChunk_s * rate_hz));
  if (chunk < 2) return std::nullopt;
  const auto [first, end] = LongestRest(samples, chunk);
  ImuNoise noise;
  noise.rest_s = static_cast<double>(end - first) / rate_hz;
  if (!(noise.rest_s >= kLeast_s)) return std::nullopt;
  std::vector<Eigen::Vector3d> gyro(1, Eigen::Vector3d::Zero()), acceleration = gyro;
  for (std::size_t i = first; i < end; ++i) {
    gyro.push_back(gyro.back() + samples[i].gyro - samples[first].gyro);
    acceleration.push_back(acceleration.back() + samples[i].acceleration - samples[first].acceleration);
  }
  for (std::size_t length = 1; 4 * length <= end - first; length *= 2) {
    noise.tau_s.push_back(static_cast<double>(length) / rate_hz);
    noise.gyro.push_back(AllanDeviation(gyro, length));
    noise.acceleration.push_back(AllanDeviation(acceleration, length));
  }
  const auto second = static_cast<std::size_t>(std::lround(rate_hz));  // where the deviation is the density
  noise.gyro_density = AllanDeviation(gyro, second);
  noise.acceleration_density = AllanDeviation(acceleration, second);
  return noise;
}

}  // namespace

std::string FormattedText(const char* format, ...) {
  char text[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  return text;
}

ImuReport CheckSamples(const std::vector<ImuSample>& samples) {
  ImuReport report;
  report.samples = samples.size();
  if (samples.size() < 2) {
    report.findings.push_back({"there are no measurements", "look whether the IMU was switched on"});
    return report;
  }
  CheckTimes(samples, &report);
  const double stuck = LongestStuck(samples);
  if (stuck > kStuck_s)
    report.findings.push_back({FormattedText("it is stuck: for %.1f s all values are the same", stuck),
                               "look at its cable and driver; no sensor is without noise"});
  CheckAccelerations(samples, &report);
  if (stuck <= kStuck_s) report.noise = NoiseAtRest(samples, report.rate_hz);
  return report;
}

void CheckOverlap(const std::vector<ImuSample>& samples, double first_frame_s, double last_frame_s,
                  ImuReport* report) {
  if (samples.empty() || !(last_frame_s > first_frame_s)) return;
  const auto [first, last] =
      std::minmax_element(samples.begin(), samples.end(),
                          [](const ImuSample& a, const ImuSample& b) { return a.stamp_s < b.stamp_s; });
  const double covered = std::min(last->stamp_s, last_frame_s) - std::max(first->stamp_s, first_frame_s);
  if (covered >= kLeastCovered * (last_frame_s - first_frame_s)) return;
  report->findings.push_back(
      {FormattedText("its stamps, %.3f to %.3f s, cover %.0f %% of those of the images, %.3f to %.3f s",
                     first->stamp_s, last->stamp_s,
                     100 * std::max(0.0, covered / (last_frame_s - first_frame_s)), first_frame_s,
                     last_frame_s),
       "give the measurements of this recording, stamped by the clock of the images"});
}

std::string ImuText(const ImuReport& report) {
  return FormattedText("IMU: %zu measurements, %.0f Hz, %.1f s", report.samples, report.rate_hz,
                       report.duration_s);
}

}  // namespace tutti
