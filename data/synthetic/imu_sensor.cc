#include "data/synthetic/imu_sensor.h"

#include <cmath>
#include <cstdio>
#include <sstream>

#include "data/synthetic/synthetic_random.h"
#include "tutti/core/error.h"

namespace tutti::synthetic {
namespace {

constexpr double kGravity = 9.81;  // [m/s^2]
constexpr double kDegree = M_PI / 180;

Eigen::Vector3d Drawn(Random& random, double sigma) {
  const double x = random.Normal(), y = random.Normal(), z = random.Normal();
  return sigma * Eigen::Vector3d(x, y, z);
}

}  // namespace

ImuSensor ImuSensorOf(const std::string& name) {
  ImuSensor s;
  s.name = name;
  if (name == "adis16448") {  // noise as in EuRoC's imu0/sensor.yaml
    s.gyro_noise = 1.6968e-4, s.gyro_random_walk = 1.9393e-5, s.gyro_bias = 0.04;
    s.acceleration_noise = 2.0e-3, s.acceleration_random_walk = 3.0e-3, s.acceleration_bias = 0.1;
    s.scale_error = 1e-3;
  } else if (name == "bmi055") {  // Bosch's data sheet: 0.014 deg/s and 150 micro-g per sqrt(Hz)
    s.gyro_noise = 0.014 * kDegree, s.gyro_random_walk = 2e-5, s.gyro_bias = 1 * kDegree;
    s.acceleration_noise = 150e-6 * kGravity, s.acceleration_random_walk = 5e-4, s.acceleration_bias = 0.35;
    s.scale_error = 5e-3;
  } else if (name == "phone") {  // 100 Hz, stamped by another clock
    s.rate_hz = 100;
    s.gyro_noise = 0.01 * kDegree, s.gyro_random_walk = 5e-5, s.gyro_bias = 0.5 * kDegree;
    s.acceleration_noise = 230e-6 * kGravity, s.acceleration_random_walk = 1e-3, s.acceleration_bias = 0.2;
    s.scale_error = 1e-2, s.late_s = 0.012;
  } else {
    throw InputError("'" + name + "' is no IMU that can be rendered; there are bmi055, adis16448 and phone");
  }
  return s;
}

std::vector<ImuSample> SampleImu(const PoseSpline& path, const ImuSensor& sensor, std::uint64_t seed) {
  Random random(seed * 0x9E3779B1ULL + 71);
  Eigen::Vector3d gyro_bias = Drawn(random, sensor.gyro_bias);
  Eigen::Vector3d acceleration_bias = Drawn(random, sensor.acceleration_bias);
  const Eigen::Array3d gyro_scale = 1 + Drawn(random, sensor.scale_error).array();
  const Eigen::Array3d acceleration_scale = 1 + Drawn(random, sensor.scale_error).array();
  const double step = 1 / sensor.rate_hz, white = std::sqrt(sensor.rate_hz), walk = std::sqrt(step);
  const Eigen::Vector3d up(0, 0, kGravity);
  std::vector<ImuSample> samples;
  for (std::size_t i = 0; static_cast<double>(i) * step <= path.Length(); ++i) {
    const double t = static_cast<double>(i) * step;
    ImuSample sample;
    sample.stamp_s = path.Begin() + t + sensor.late_s;
    sample.gyro = (gyro_scale * path.AngularVelocity(t).array()).matrix() + gyro_bias;
    sample.gyro += Drawn(random, sensor.gyro_noise * white);
    const Eigen::Vector3d felt = path.At(t).rotation.conjugate() * (path.Acceleration(t) + up);
    sample.acceleration = (acceleration_scale * felt.array()).matrix() + acceleration_bias;
    sample.acceleration += Drawn(random, sensor.acceleration_noise * white);
    gyro_bias += Drawn(random, sensor.gyro_random_walk * walk);
    acceleration_bias += Drawn(random, sensor.acceleration_random_walk * walk);
    samples.push_back(sample);
  }
  return samples;
}

std::string EurocImuCsv(const std::vector<ImuSample>& samples) {
  std::string text =
      "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],"
      "a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n";
  for (const ImuSample& s : samples) {
    char line[256];
    std::snprintf(line, sizeof line, "%lld,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g\n", std::llround(s.stamp_s * 1e9),
                  s.gyro.x(), s.gyro.y(), s.gyro.z(), s.acceleration.x(), s.acceleration.y(),
                  s.acceleration.z());
    text += line;
  }
  return text;
}

std::string EurocImuYaml(const ImuSensor& sensor) {
  std::ostringstream out;
  out << "sensor_type: imu\ncomment: " << sensor.name
      << "\n# The IMU is the body.\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1.0, 0.0, 0.0, 0.0,\n         0.0, "
         "1.0, 0.0, 0.0,\n         0.0, 0.0, 1.0, 0.0,\n         0.0, 0.0, 0.0, 1.0]\nrate_hz: "
      << sensor.rate_hz << "\n";
  if (sensor.gyro_noise > 0)
    out << "gyroscope_noise_density: " << sensor.gyro_noise << "  # [rad/s/sqrt(Hz)]\n"
        << "gyroscope_random_walk: " << sensor.gyro_random_walk << "  # [rad/s^2/sqrt(Hz)]\n"
        << "accelerometer_noise_density: " << sensor.acceleration_noise << "  # [m/s^2/sqrt(Hz)]\n"
        << "accelerometer_random_walk: " << sensor.acceleration_random_walk << "  # [m/s^3/sqrt(Hz)]\n";
  return out.str();
}

}  // namespace tutti::synthetic
