#include "tests/support/rendered_world.h"

#include <unistd.h>

#include <fstream>
#include <opencv2/core/version.hpp>
#include <sstream>

#include "core/byte_stream.h"
#include "tests/support/made_once.h"
#include "tutti/core/error.h"

namespace tutti::testing {
namespace {

namespace fs = std::filesystem;

void Write(const fs::path& file, const std::string& bytes) {
  fs::path part = file;
  part += "." + std::to_string(getpid());
  std::ofstream(part, std::ios::binary) << bytes;
  fs::rename(part, file);  // another test may be writing the same
}

std::string Read(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

void PutImage(const cv::Mat& image, internal::ByteWriter& out) {
  for (const int number : {image.rows, image.cols, image.type()}) out.Put(number);
  for (int y = 0; y < image.rows; ++y)
    out.PutRaw(image.ptr(y), static_cast<std::size_t>(image.cols) * image.elemSize());
}

cv::Mat GetImage(internal::ByteReader& in) {
  const int rows = in.Get<int>(), cols = in.Get<int>(), type = in.Get<int>();
  if (rows == 0) return {};
  cv::Mat image(rows, cols, type);
  in.GetRaw(image.data, image.total() * image.elemSize());
  return image;
}

}  // namespace

std::string TextOf(const SyntheticOptions& options) {
  // All of them: with another number of names this does not compile.
  const auto& [seed, scene, sensor, width, height, focal_px, baseline_m, sides_deg, pitch_deg, rate_hz,
               max_depth_m, depth_units_per_m, path, laps, frames, speed_mps, blocks_x, blocks_y, block_m,
               street_m, repeat_fraction, facades, sign_fraction, road_surfaces, hills_m, bare_fraction,
               plain_doors, corridor_m, noise_sigma, motion_blur_s, readout_s, depth_delay_s, shake_deg_per_s,
               lighting_change, dusk, other_cars, occlusion, moving_objects, kinect_noise, supersample] =
      options;
  if (path) throw InputError("frames along a path are not kept");
  std::ostringstream text;
  text.precision(17);
  const auto put = [&text](const auto&... values) { ((text << values << ' '), ...); };
  put(CV_VERSION, seed, static_cast<int>(scene), static_cast<int>(sensor), width, height, focal_px,
      baseline_m, sides_deg, pitch_deg, rate_hz, max_depth_m, depth_units_per_m, laps, frames, speed_mps,
      blocks_x, blocks_y, block_m, street_m, repeat_fraction, facades, sign_fraction, road_surfaces, hills_m,
      bare_fraction, plain_doors, corridor_m, noise_sigma, motion_blur_s, readout_s, depth_delay_s,
      shake_deg_per_s, lighting_change, dusk, other_cars, occlusion, moving_objects, kinect_noise,
      supersample);
  return text.str();
}

RenderedWorld::RenderedWorld(const SyntheticOptions& options)
    : given_(options),
      options_(options.Resolved()),
      folder_(MadeOnce("frames-" + DigestOf(TextOf(options)), TUTTI_RENDERER, [this](const fs::path& folder) {
        fs::create_directories(folder);
        internal::ByteWriter out;
        out.Put(World().Camera());
        out.Put(World().Size());
        out.Put(World().FramesPerLap());
        Write(folder / "world", out.bytes());
      })) {
  const std::string bytes = Read(folder_ / "world");
  internal::ByteReader in(bytes, "world");
  camera_ = in.Get<PinholeCamera>();
  size_ = in.Get<std::size_t>();
  frames_per_lap_ = in.Get<std::size_t>();
}

const SyntheticWorld& RenderedWorld::World() const {
  if (!world_) world_ = std::make_unique<SyntheticWorld>(given_);
  return *world_;
}

SyntheticFrame RenderedWorld::Render(std::size_t i) const {
  const fs::path file = folder_ / std::to_string(i);
  if (!fs::exists(file)) {
    SyntheticFrame frame = World().Render(i);
    internal::ByteWriter out;
    out.Put(frame.stamp_s);
    for (const double number : frame.T_world_camera.rotation.coeffs()) out.Put(number);
    for (const double number : frame.T_world_camera.translation) out.Put(number);
    for (const cv::Mat& image : {frame.image, frame.right, frame.depth_m}) PutImage(image, out);
    Write(file, out.bytes());
    return frame;
  }
  const std::string bytes = Read(file);
  internal::ByteReader in(bytes, file.string());
  SyntheticFrame frame;
  frame.stamp_s = in.Get<double>();
  for (double& number : frame.T_world_camera.rotation.coeffs()) number = in.Get<double>();
  for (double& number : frame.T_world_camera.translation) number = in.Get<double>();
  for (cv::Mat* image : {&frame.image, &frame.right, &frame.depth_m}) *image = GetImage(in);
  return frame;
}

}  // namespace tutti::testing
