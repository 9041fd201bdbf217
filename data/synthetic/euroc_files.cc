#include "data/synthetic/given_path.h"

#include <cmath>
#include <sstream>

#include "core/replaced_file.h"

namespace tutti::synthetic {
namespace {

namespace fs = std::filesystem;

std::string List(const std::vector<double>& values) {
  std::ostringstream out;
  out.precision(15);
  for (std::size_t i = 0; i < values.size(); ++i) out << (i == 0 ? "[" : ", ") << values[i];
  out << "]";
  return out.str();
}

std::string SensorText(const MountedCamera& mounted, double rate_hz) {
  const PinholeCamera& c = mounted.camera;
  const Eigen::Matrix4d T = mounted.T_body_camera.Matrix();
  std::vector<double> rows;
  for (int i = 0; i < 16; ++i) rows.push_back(T(i / 4, i % 4));
  std::ostringstream out;
  out << "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: " << List(rows)
      << "\nrate_hz: " << rate_hz << "\nresolution: " << List({double(c.width), double(c.height)})
      << "\ncamera_model: pinhole\nintrinsics: " << List({c.fx, c.fy, c.cx, c.cy})
      << "  # fu, fv, cu, cv\ndistortion_model: radial-tangential\ndistortion_coefficients: "
      << List({c.coefficients[0], c.coefficients[1], c.coefficients[2], c.coefficients[3]}) << "\n";
  return out.str();
}

}  // namespace

std::vector<std::string> EurocImageFolders(SyntheticSensor sensor) {
  std::vector<std::string> folders = {"mav0/cam0/data"};
  if (sensor == SyntheticSensor::kStereo) folders.emplace_back("mav0/cam1/data");
  if (sensor == SyntheticSensor::kRgbd) folders.emplace_back("mav0/depth0/data");
  return folders;
}

std::string EurocName(double stamp_s) { return std::to_string(std::llround(stamp_s * 1e9)) + ".png"; }

void WriteEurocLists(const SyntheticWorld& world, std::size_t frames, const fs::path& folder) {
  const GivenPath& path = *world.Options().path;
  const double length = path.stamps_s.back() - path.stamps_s.front();
  const double rate = length > 0 ? static_cast<double>(path.stamps_s.size() - 1) / length : 1;
  std::string list = "#timestamp [ns],filename\n";
  Trajectory bodies;
  for (std::size_t i = 0; i < frames; ++i) {
    const double stamp = path.stamps_s[i];
    list += std::to_string(std::llround(stamp * 1e9)) + "," + EurocName(stamp) + "\n";
    bodies.push_back({stamp, path.spline.At(stamp - path.spline.Begin())});
  }
  const std::vector<std::string> folders = EurocImageFolders(world.Options().sensor);
  for (std::size_t k = 0; k < folders.size(); ++k) {
    const fs::path sensor = (folder / folders[k]).parent_path();
    internal::WriteFile(sensor / "data.csv", list);
    // Depth images are registered to the colour ones.
    const std::size_t camera = world.Options().sensor == SyntheticSensor::kStereo ? k : 0;
    internal::WriteFile(sensor / "sensor.yaml", SensorText(path.cameras[camera], rate));
  }
  const fs::path truth = folder / "mav0" / "state_groundtruth_estimate0";
  fs::create_directories(truth);
  WriteTrajectory(truth / "data.csv", bodies, TrajectoryFormat::kEuroc);
}

}  // namespace tutti::synthetic
