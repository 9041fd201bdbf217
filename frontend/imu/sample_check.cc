#include "frontend/imu/imu_examination.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>

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
