#include "data/synthetic/synthetic_world.h"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <exception>
#include <mutex>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "core/replaced_file.h"
#include "core/text_reader.h"
#include "data/synthetic/given_path.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

// "1.200000"
std::string Fixed(double value) {
  char text[64];
  std::snprintf(text, sizeof text, "%.6f", value);
  return text;
}
// "1.200000000000e+00"
std::string Scientific(double value) {
  char text[64];
  std::snprintf(text, sizeof text, "%.12e", value);
  return text;
}

// "000012.png" (KITTI), "1.200000.png" (TUM).
std::string NumberName(std::size_t i) {
  char text[32];
  std::snprintf(text, sizeof text, "%06zu.png", i);
  return text;
}
std::string StampName(double stamp_s) { return Fixed(stamp_s) + ".png"; }

void WriteImage(const fs::path& file, const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  cv::imencode(".png", image, bytes, {cv::IMWRITE_PNG_COMPRESSION, 1});
  internal::WriteFile(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

constexpr const char* kImageFolders[] = {"image_0", "image_1",        "images",         "rgb",
                                         "depth",   "mav0/cam0/data", "mav0/cam1/data", "mav0/depth0/data"};
constexpr const char* kWritten = "# Written by `tutti generate`";

// NumberName and StampName make such names: at least six digits, or a number with six decimals.
bool IsOwnName(const std::string& name) {
  constexpr const char* kDigits = "0123456789";
  const std::size_t digits = std::min(name.find_first_not_of(kDigits), name.size());
  const std::string rest = name.substr(digits);
  if (digits >= 6 && rest == ".png") return true;
  return digits >= 1 && rest.size() == 11 && rest[0] == '.' && rest.find_first_not_of(kDigits, 1) == 7 &&
         rest.substr(7) == ".png";
}

// True unless the folder holds another one's recording, whose files may have the same names.
bool IsOwnFolder(const fs::path& folder) {
  std::error_code code;
  bool recording = false;
  for (const char* part : {"image_0", "image_1", "rgb", "depth", "mav0"})
    recording = recording || fs::exists(folder / part, code);
  if (!recording) return true;
  try {
    std::string first;
    return internal::TextReader(folder / "config.yaml").Next(first) && first.rfind(kWritten, 0) == 0;
  } catch (const InputError&) {
    return false;  // no file, or no text
  }
}

// Old frames would mix with the new ones. Nothing is removed if something must stay.
void RemoveOwn(const fs::path& folder) {
  if (!IsOwnFolder(folder))
    throw InputError(folder.string() +
                     ": holds a recording that tutti generate did not write (its config.yaml "
                     "would say so), which --force leaves alone; give another folder");
  std::error_code code;
  std::vector<fs::path> stale;
  for (const char* part : kImageFolders) {
    if (fs::is_symlink(folder / part, code))
      throw InputError((folder / part).string() +
                       ": is a symbolic link, and --force removes nothing behind one; remove the link, or "
                       "give another folder");
    for (fs::directory_iterator it(folder / part, code), end; !code && it != end; it.increment(code)) {
      if (!IsOwnName(it->path().filename().string()))
        throw InputError(it->path().string() +
                         ": is none of tutti generate's files, so --force leaves it alone; "
                         "move it, or give another folder");
      stale.push_back(it->path());
    }
  }
  for (const fs::path& file : stale) fs::remove(file, code);
  for (const char* part : kImageFolders) fs::remove(folder / part, code);
  for (const char* list :
       {"config.yaml", "times.txt", "calib.txt", "poses.txt", "rgb.txt", "depth.txt", "groundtruth.txt",
        "mav0/imu0/data.csv", "mav0/imu0/sensor.yaml", "mav0/state_groundtruth_estimate0/data.csv"})
    fs::remove(folder / list, code);
}

void PrepareFolder(const fs::path& folder, const std::vector<std::string>& parts, bool force) {
  std::error_code code;
  if (fs::exists(folder, code) && !fs::is_directory(folder, code))
    throw InputError(folder.string() + ": is a file; give a folder");
  if (fs::exists(folder, code) && !fs::is_empty(folder, code)) {
    if (!force)
      throw InputError(folder.string() + ": is not empty; give another folder, or --force to write into it");
    RemoveOwn(folder);
  }
  for (const std::string& part : parts) {
    fs::create_directories(folder / part, code);
    if (code)
      throw InputError((folder / part).string() + ": can't be made (" + code.message() +
                       "); check the permissions");
  }
}

const char* SceneName(SyntheticScene scene) {
  switch (scene) {
    case SyntheticScene::kTown:
      return "town";
    case SyntheticScene::kRoom:
      return "room";
    case SyntheticScene::kHall:
      return "hall";
    case SyntheticScene::kCorridor:
      break;
  }
  return "corridor";
}

// The file that `tutti run --config` takes.
std::string ConfigText(const SyntheticWorld& world) {
  const SyntheticOptions& o = world.Options();
  const PinholeCamera& c = world.Camera();
  std::ostringstream out;
  out.precision(10);
  const bool rgbd = o.sensor == SyntheticSensor::kRgbd, stereo = o.sensor == SyntheticSensor::kStereo;
  out << kWritten << ": synthetic " << SceneName(o.scene) << ", seed " << o.seed
      << ".\n# tutti run --config THIS_FILE --dataset THIS_FOLDER --out DIR\n"
      << "dataset:\n  type: "
      << (o.path ? "euroc"
          : rgbd ? "tum"
                 : "kitti")
      << "  # layout on disk\n"
      << "  sensor: "
      << (rgbd     ? "rgbd"
          : stereo ? "stereo"
                   : "mono")
      << "\n";
  if (!o.path) out << "  rate_hz: " << o.rate_hz << "  # frames per second\n";
  if (rgbd)
    out << "  depth_units_per_m: " << o.depth_units_per_m << "  # value in the depth image of one metre\n"
        << "  max_depth_m: " << o.max_depth_m << "  # nothing is measured beyond [m]\n";
  if (o.path) return out.str();  // sensor.yaml has the cameras
  out << "camera:\n  width: " << c.width << "  # [px]\n  height: " << c.height << "\n  fx: " << c.fx
      << "  # [px]\n  fy: " << c.fy << "\n  cx: " << c.cx << "\n  cy: " << c.cy << "\n  distortion: none\n";
  if (stereo)
    out << "  baseline_m: " << o.baseline_m << "  # the right camera lies so far to the right [m]\n";
  if (o.readout_s > 0)
    out << "  readout_s: " << o.readout_s << "  # the last row is read so long after the first [s]\n";
  if (o.depth_delay_s != 0)
    out << "  depth_delay_s: " << o.depth_delay_s << "  # depth is taken so long before its time stamp [s]\n";
  return out.str();
}

std::string CalibrationText(const SyntheticWorld& world) {
  const PinholeCamera& c = world.Camera();
  std::string out;
  for (int i = 0; i < 4; ++i) {  // P2 and P3 are KITTI's colour cameras: here the same ones
    const double offset = i % 2 == 1 ? -c.fx * world.Options().baseline_m : 0.0;
    const double p[12] = {c.fx, 0, c.cx, offset, 0, c.fy, c.cy, 0, 0, 0, 1, 0};
    out += "P" + std::to_string(i) + ":";
    for (const double value : p) out += " " + Scientific(value);
    out += "\n";
  }
  return out;
}

std::vector<std::string> ImageFolders(SyntheticSensor sensor) {
  switch (sensor) {
    case SyntheticSensor::kRgbd:
      return {"rgb", "depth"};
    case SyntheticSensor::kStereo:
      return {"image_0", "image_1"};
    case SyntheticSensor::kSides:
      return {"images"};
    case SyntheticSensor::kMono:
      break;
  }
  return {"image_0"};
}

class Writer {
 public:
  Writer(const SyntheticWorld& world, fs::path folder, const SyntheticWriteOptions& options)
      : world_(world),
        folder_(std::move(folder)),
        options_(options),
        sensor_(world.Options().sensor),
        along_path_(world.Options().path != nullptr) {}

  std::size_t Run() {
    PrepareFolder(folder_, along_path_ ? synthetic::EurocImageFolders(sensor_) : ImageFolders(sensor_),
                  options_.force);
    if (sensor_ != SyntheticSensor::kSides) internal::WriteFile(folder_ / "config.yaml", ConfigText(world_));
    std::vector<std::thread> threads;
    try {
      for (int k = 1; k < std::max(1, options_.threads); ++k) threads.emplace_back([this] { Work(); });
    } catch (const std::system_error&) {  // the system has no more: those that are there do all
    }
    Work();
    for (std::thread& thread : threads) thread.join();
    if (failure_) std::rethrow_exception(failure_);
    const std::size_t count = std::min<std::size_t>(next_, world_.Size());
    WriteLists(count);
    return count;
  }

 private:
  // Takes frames in order until all are taken or one thread stopped: then those taken so far are complete.
  void Work() {
    while (!stop_) {
      std::size_t i = 0;
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (stop_ || next_ >= world_.Size()) return;
        i = next_++;
      }
      try {
        WriteFrame(i);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (!failure_) failure_ = std::current_exception();
        stop_ = true;
      }
      const std::lock_guard<std::mutex> lock(mutex_);
      ++done_;
      if (options_.progress && !options_.progress(done_, world_.Size())) stop_ = true;
    }
  }

  void WriteFrame(std::size_t i) const {
    const SyntheticFrame frame = world_.Render(i);
    if (along_path_) return WriteEurocFrame(frame);
    if (sensor_ == SyntheticSensor::kRgbd) {
      const std::string name = StampName(frame.stamp_s);
      WriteImage(folder_ / "rgb" / name, frame.image);
      WriteImage(folder_ / "depth" / name, DepthOf(frame));
    } else if (sensor_ == SyntheticSensor::kSides) {
      WriteImage(folder_ / "images" / NumberName(2 * i + 1), frame.image);
      WriteImage(folder_ / "images" / NumberName(2 * i + 2), frame.right);
    } else {
      WriteImage(folder_ / "image_0" / NumberName(i), frame.image);
      if (sensor_ == SyntheticSensor::kStereo) WriteImage(folder_ / "image_1" / NumberName(i), frame.right);
    }
  }

  cv::Mat DepthOf(const SyntheticFrame& frame) const {
    cv::Mat depth;
    frame.depth_m.convertTo(depth, CV_16U, world_.Options().depth_units_per_m);
    return depth;
  }

  void WriteEurocFrame(const SyntheticFrame& frame) const {
    const std::vector<std::string> folders = synthetic::EurocImageFolders(sensor_);
    const std::string name = synthetic::EurocName(frame.stamp_s);
    WriteImage(folder_ / folders[0] / name, frame.image);
    if (folders.size() > 1)
      WriteImage(folder_ / folders[1] / name, frame.right.empty() ? DepthOf(frame) : frame.right);
  }

  void WriteLists(std::size_t count) const {
    if (along_path_) return synthetic::WriteEurocLists(world_, count, folder_);
    Trajectory truth = world_.GroundTruth();
    truth.resize(count);
    if (sensor_ == SyntheticSensor::kRgbd) {
      for (const char* part : {"rgb", "depth"}) {
        std::string list = "# timestamp filename\n";
        for (const StampedPose& p : truth)
          list += Fixed(p.stamp_s) + " " + part + "/" + StampName(p.stamp_s) + "\n";
        internal::WriteFile(folder_ / (std::string(part) + ".txt"), list);
      }
      WriteTrajectory(folder_ / "groundtruth.txt", truth, TrajectoryFormat::kTum);
    } else {
      std::string times;
      for (const StampedPose& p : truth) times += Scientific(p.stamp_s) + "\n";
      internal::WriteFile(folder_ / "times.txt", times);
      if (sensor_ != SyntheticSensor::kSides)
        internal::WriteFile(folder_ / "calib.txt", CalibrationText(world_));
      WriteTrajectory(folder_ / "poses.txt", truth, TrajectoryFormat::kKitti);
    }
  }

  const SyntheticWorld& world_;
  const fs::path folder_;
  const SyntheticWriteOptions& options_;
  const SyntheticSensor sensor_;
  const bool along_path_;
  std::mutex mutex_;
  std::size_t next_ = 0, done_ = 0;
  std::atomic<bool> stop_{false};
  std::exception_ptr failure_;
};

}  // namespace

std::size_t WriteSyntheticDataset(const SyntheticWorld& world, const std::filesystem::path& folder,
                                  const SyntheticWriteOptions& options) {
  return Writer(world, folder, options).Run();
}

}  // namespace tutti
