// tutti generate: renders the synthetic world to disk, or changes real images.
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "apps/run/interrupt.h"
#include "apps/run/progress.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/files.h"
#include "apps/tutti/generate_path.h"
#include "apps/tutti/loops/loops_input.h"
#include "apps/tutti/options.h"
#include "core/replaced_file.h"
#include "core/terminal.h"
#include "data/synthetic/image_change.h"
#include "data/synthetic/synthetic_world.h"
#include "frontend/dataset/image_file.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

struct GenerateArguments {
  std::string out;
  std::optional<SyntheticSensor> sensor;
  SyntheticOptions world;
  PathArguments path;
  const CLI::Option* scene = nullptr;  // --world
  std::string from_images, change;     // the first empty: a synthetic world
  int stride = 1;                      // every stride-th image is taken
  int change_from = 0;                 // those before this one (of the taken) are copied as they are
  int threads = 0;
  bool force = false;  // write into a folder that is not empty: its images are removed

  int Threads() const {
    return threads > 0 ? threads : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  }
};

// The progress of what is written; false: Ctrl-C.
std::function<bool(std::size_t, std::size_t)> ReportTo(std::optional<Progress>& progress) {
  return [&progress](std::size_t done, std::size_t total) {
    if (!progress) progress.emplace("generate", total);
    progress->Update(done, "");
    if (done == total || InterruptGuard::Requested()) progress->Finish();
    return !InterruptGuard::Requested();
  };
}

// Makes or empties the folder. `stems`: of all images in `from`, which an earlier call has written from.
void Prepare(const fs::path& from, const fs::path& out, const std::set<std::string>& stems, bool force) {
  std::error_code error;
  if (fs::equivalent(from, out, error)) {
    throw InputError(out.string() + ": holds the images that are read; give another folder");
  }
  if (fs::exists(out, error) && !fs::is_directory(out, error)) {
    throw InputError(out.string() + ": is a file; give a folder");
  }
  if (fs::exists(out, error) && !fs::is_empty(out, error)) {
    if (!force)
      throw InputError(out.string() + ": is not empty; give another folder, or --force to write into it");
    const std::vector<fs::path> old = ImagesIn(out);
    for (const fs::path& image : old) {
      if (stems.count(image.stem().string()) > 0) continue;
      throw InputError(image.string() + ": was not made from an image in " + from.string() +
                       ", so --force leaves it alone; move it, or give another folder");
    }
    for (const fs::path& image : old) fs::remove(image, error);
  }
  MakeFolder(out);
}

// An image with three channels that are all the same is grey (webp has no grey of its own).
cv::Mat GreyIfColourless(const cv::Mat& image) {
  if (image.channels() != 3) return image;
  std::vector<cv::Mat> channels;
  cv::split(image, channels);
  const bool grey = cv::norm(channels[0], channels[1], cv::NORM_INF) == 0 &&
                    cv::norm(channels[0], channels[2], cv::NORM_INF) == 0;
  return grey ? channels[0] : image;
}

// Writes each taken image under its old name, but as PNG; those that are not changed are copied byte for
// byte. The files do not depend on the number of threads. Throws InputError that names the folder or file.
class ChangedImages {
 public:
  explicit ChangedImages(const GenerateArguments& arguments)
      : change_(ImageChange::Parse(arguments.change)), arguments_(arguments) {
    const std::vector<fs::path> all = ListImages(arguments.from_images, true, &notes_);
    for (const fs::path& image : all) all_stems_.insert(image.stem().string());
    for (std::size_t i = 0; i < all.size(); i += static_cast<std::size_t>(arguments.stride))
      images_.push_back(all[i]);
    FindRange();
    std::set<std::string> stems;
    for (const fs::path& image : images_) {
      if (!stems.insert(image.stem().string()).second) {
        throw InputError(image.string() +
                         ": another image of the folder has this name with another ending; "
                         "all are written as png, so rename one");
      }
    }
  }

  // `progress` is called after each image with (done, total), from one thread at a time; false: stop.
  void Write(const std::function<bool(std::size_t, std::size_t)>& progress) {
    progress_ = progress;
    Prepare(arguments_.from_images, arguments_.out, all_stems_, arguments_.force);
    std::vector<std::thread> threads;
    try {
      for (int k = 1; k < arguments_.Threads(); ++k) threads.emplace_back([this] { Work(); });
    } catch (const std::system_error&) {  // the system has no more: those that are there do all
    }
    Work();
    for (std::thread& thread : threads) thread.join();
    if (failure_) std::rethrow_exception(failure_);
  }

  const ImageChange& change() const { return change_; }
  std::size_t taken() const { return images_.size(); }
  std::size_t written() const { return next_; }                     // less if `progress` said stop
  const std::vector<std::string>& notes() const { return notes_; }  // of what was left out

 private:
  // Takes images in order until all are taken or one thread stopped: then those taken so far are complete.
  void Work() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!stop_ && next_ < images_.size()) {
      const std::size_t i = next_++;
      lock.unlock();
      std::exception_ptr failure;
      try {
        WriteOne(i);
      } catch (...) {
        failure = std::current_exception();
      }
      lock.lock();
      ++done_;
      if (failure) {
        failure_ = failure_ ? failure_ : failure;
        stop_ = true;
      } else if (!progress_(done_, images_.size())) {
        stop_ = true;
      }
    }
  }

  // OpenCV makes 8 bit of 16 by leaving out the lower ones, where all is that a thermal camera sees.
  void FindRange() {
    constexpr std::size_t kLooked = 8;
    std::vector<cv::Mat> greys;
    for (std::size_t k = 0; k < std::min(kLooked, images_.size()); ++k) {
      const ImageFile read = ReadGreyFile(images_[k * images_.size() / kLooked]);
      if (k == 0 && read.image.depth() != CV_16U) return;
      greys.push_back(read.image);
    }
    range_ = RangeOf(greys);
    if (range_.narrow) notes_.push_back(arguments_.from_images + ": " + RangeText(range_));
  }
  cv::Mat Stretched(const fs::path& file) const {
    const ImageFile read = ReadGreyFile(file);
    if (!read.error.empty()) throw InputError(read.error);
    return To8Bit(read.image, range_);
  }

  void WriteOne(std::size_t i) const {
    const fs::path& from = images_[i];
    if (static_cast<int>(i) < arguments_.change_from) {
      std::error_code error;
      internal::ReplacedFile copy(fs::path(arguments_.out) / from.filename());
      fs::copy_file(from, copy.part(), fs::copy_options::overwrite_existing, error);
      if (!error) return copy.Commit();
      throw InputError(from.string() + ": can't be copied (" + error.message() + ")");
    }
    const ImageFile read = ReadImageFile(from, cv::IMREAD_ANYCOLOR);
    if (!read.error.empty()) throw InputError(read.error);
    const cv::Mat image = range_.narrow ? Stretched(from) : read.image;
    const fs::path to = fs::path(arguments_.out) / (from.stem().string() + ".png");
    const cv::Mat changed =
        change_.Apply(GreyIfColourless(image), arguments_.world.seed, static_cast<int>(i));
    WritePngFile(to, changed, {cv::IMWRITE_PNG_COMPRESSION, 1});
  }

  const ImageChange change_;
  const GenerateArguments& arguments_;
  std::function<bool(std::size_t, std::size_t)> progress_;
  std::vector<fs::path> images_;
  std::vector<std::string> notes_;
  GreyRange range_;
  std::set<std::string> all_stems_;  // with those that the stride leaves out
  std::mutex mutex_;                 // of what follows
  std::size_t next_ = 0, done_ = 0;
  bool stop_ = false;
  std::exception_ptr failure_;
};

// Says so where not all could be written. Returns the exit status.
int Interrupted(const std::string& out, std::size_t written, std::size_t all, const char* what) {
  internal::Say("interrupted: %s holds the first %zu of %zu %s and can be used", out.c_str(), written, all,
                what);
  return 130;
}

int ChangeImages(const GenerateArguments& arguments) {
  std::optional<Progress> progress;
  const InterruptGuard guard;
  ChangedImages images(arguments);
  images.Write(ReportTo(progress));
  for (const std::string& note : images.notes()) internal::Say("%s", note.c_str());
  if (images.written() < images.taken())
    return Interrupted(arguments.out, images.written(), images.taken(), "images");
  const char* d = arguments.out.c_str();
  std::printf("%s: %zu images, changed by %s:%d", d, images.written(), images.change().Name().c_str(),
              images.change().Strength());
  if (arguments.change_from > 0) std::printf(" from image %d on (counted from 0)", arguments.change_from);
  std::printf(
      ". Next, with the ground truth of the images they are from:\n  tutti loops --images %s --ground-truth "
      "FILE --out %s_loops\n",
      d, d);
  return 0;
}

// What was written along a path.
int EndPath(const GenerateArguments& arguments, const SyntheticWorld& world, std::size_t frames) {
  const std::size_t samples = WriteImu(arguments.path, world.Options(), arguments.out);
  if (frames < world.Size()) return Interrupted(arguments.out, frames, world.Size(), "frames");
  const char* d = arguments.out.c_str();
  std::printf("%s: %zu frames", d, frames);
  if (samples > 0) std::printf(" and %zu measurements of an IMU", samples);
  std::printf(" along %s, in EuRoC's layout with ground truth. Next:\n  tutti run %s --out %s_run\n",
              arguments.path.trajectory.c_str(), d, d);
  return 0;
}

int Generate(const GenerateArguments& arguments) {
  if (!arguments.from_images.empty()) return ChangeImages(arguments);
  if (!arguments.sensor) throw CLI::RequiredError("--sensor (or --from-images)");
  SyntheticOptions wanted = arguments.world;
  wanted.sensor = *arguments.sensor;
  SetPath(arguments.path, arguments.scene != nullptr && arguments.scene->count() > 0, &wanted);
  const SyntheticWorld world(wanted);
  const SyntheticOptions& o = world.Options();
  if (o.path)
    internal::Say("%zu frames of %dx%d along %s, into %s", world.Size(), world.Camera().width,
                  world.Camera().height, arguments.path.trajectory.c_str(), arguments.out.c_str());
  else
    internal::Say("%zu frames of %dx%d, %.0f m a lap (%zu frames), into %s", world.Size(), o.width, o.height,
                  world.LapLength(), world.FramesPerLap(), arguments.out.c_str());
  SyntheticWriteOptions write;
  write.force = arguments.force;
  write.threads = arguments.Threads();
  std::optional<Progress> progress;
  write.progress = ReportTo(progress);
  const InterruptGuard guard;
  const std::size_t written = WriteSyntheticDataset(world, arguments.out, write);
  if (o.path) return EndPath(arguments, world, written);
  if (written < world.Size()) return Interrupted(arguments.out, written, world.Size(), "frames");
  const char* d = arguments.out.c_str();
  if (o.sensor == SyntheticSensor::kSides) {
    std::printf(
        "%s: %zu pairs of images with ground truth. Next:\n  tutti loops --join-pairs --images %s/images "
        "--ground-truth %s/poses.txt --out %s_loops\n",
        d, written, d, d, d);
    return 0;
  }
  std::printf(
      "%s: %zu frames with ground truth. Next:\n  tutti run --config %s/config.yaml --dataset %s --out "
      "%s_run\n",
      d, written, d, d, d);
  return 0;
}

// Real images in the world's stead: what belongs to a world is refused beside them.
void AddChangeOptions(CLI::App& c, GenerateArguments& a) {
  const std::vector<CLI::Option*> before = c.get_options([](const CLI::Option* option) {
    static const std::set<std::string> kShared = {"--help", "--out", "--seed", "--threads", "--force"};
    return kShared.count("--" + option->get_single_name()) == 0;
  });
  CLI::Option* from = c.add_option("--from-images", a.from_images,
                                   "no world: change the images of this folder, names kept, written as png")
                          ->type_name("DIR");
  for (CLI::Option* option : before) from->excludes(option);
  CLI::Option* change =
      c.add_option("--change", a.change,
                   "with --from-images: NAME or NAME:2 (strong); dark, overexposed, blur, "
                   "jpeg (quality 15, 8), half (size 1/2, 1/3), roll (15, 30 deg), occluded "
                   "(25, 40 % by lorries), rain")
          ->type_name("NAME[:1|2]")
          ->needs(from);
  from->needs(change);
  AddDefaulted(c, "--stride", a.stride, "with --from-images: take one of so many images",
               CLI::Range(1, 1000000))
      ->needs(from);
  AddDefaulted(
      c, "--change-from", a.change_from,
      "with --from-images: copy the images before this one as they are; counted from 0, after --stride",
      NotNegative())
      ->needs(from);
}

void AddOptions(CLI::App& c, GenerateArguments& a) {
  SyntheticOptions& w = a.world;
  const auto without_number = [&c](const char* number, const char* name, auto& value, const char* text) {
    c.add_option(name, value, text)->expected(0, 1)->default_str(number);
  };
  c.add_option("--out", a.out, "folder to write; made if missing, must be empty")
      ->required()
      ->type_name("DIR");
  const EnumWords<SyntheticSensor> sensors = {{"mono", SyntheticSensor::kMono},
                                              {"stereo", SyntheticSensor::kStereo},
                                              {"rgbd", SyntheticSensor::kRgbd},
                                              {"sides", SyntheticSensor::kSides}};
  AddWord(
      c, "--sensor", a.sensor,
      "mono, stereo (both in the KITTI layout), rgbd (TUM layout) or sides (pairs that look left and right)",
      sensors, CLI::IsMember({"mono", "stereo", "rgbd", "sides"}))
      ->type_name("NAME");
  const EnumWords<SyntheticScene> scenes = {{"town", SyntheticScene::kTown},
                                            {"room", SyntheticScene::kRoom},
                                            {"corridor", SyntheticScene::kCorridor},
                                            {"hall", SyntheticScene::kHall}};
  a.scene = AddWord(c, "--world", w.scene,
                    "town: streets driven through; room: furnished, walked around in; corridor: plain walls "
                    "and doors; hall: large, with --trajectory",
                    scenes, CLI::IsMember({"town", "room", "corridor", "hall"}))
                ->type_name("NAME")
                ->default_str("town");
  AddDefaulted(c, "--seed", w.seed, "of houses, textures and noise; the same seed gives the same bytes",
               NotNegative());
  AddDefaulted(c, "--laps", w.laps,
               "rounds of the closed route (fractions too); from the second on, places are seen again");
  AddDefaulted(c, "--frames", w.frames, "stop after so many frames; 0: all laps", NotNegative());
  c.add_option("--width", w.width, "image width [px] (with --height; default 640)");
  c.add_option("--height", w.height, "image height [px] (default: town 320, else 480)");
  c.add_option("--focal", w.focal_px, "focal length [px] (default: town 0.58, else 0.82 of the width)");
  c.add_option("--baseline", w.baseline_m,
               "stereo: distance of the cameras [m] (default: town 0.54, else 0.12)");
  c.add_option("--rate", w.rate_hz, "frames per second (default: town 10, else 15)");
  c.add_option("--speed", w.speed_mps, "on straights [m/s] (default: town 8, else 0.5)");
  AddDefaulted(c, "--blocks-x", w.blocks_x, "town: blocks of houses that the route goes around, in x");
  AddDefaulted(c, "--blocks-y", w.blocks_y, "town: and in y (2 or more in both: an L)");
  AddDefaulted(c, "--block", w.block_m, "town: side of a block [m]");
  AddDefaulted(c, "--repeat", w.repeat_fraction,
               "aliasing [0..1]: part of the houses (corridor: plates, posters) that look alike");
  AddDefaulted(c, "--facades", w.facades,
               "town: number of facades that differ (of cars a quarter); few are aliasing, too");
  AddDefaulted(c, "--signs", w.sign_fraction,
               "town: part of the signs that are there [0..1]; no two look alike");
  AddDefaulted(c, "--roads", w.road_surfaces,
               "town: number of road surfaces that differ; few are aliasing, too");
  AddDefaulted(c, "--bare", w.bare_fraction, "room: part of each wall behind a plain curtain [0..1]");
  AddDefaulted(c, "--plain-doors", w.plain_doors,
               "room: doors of plain paint beside the way, some 0.3 m from it at the nearest [0..4]");
  AddDefaulted(c, "--corridor", w.corridor_m,
               "corridor: longer side of the ring [m]; the other is half of it");
  AddDefaulted(c, "--sides", w.sides_deg, "sensor sides: each camera looks so far from the way [deg]");
  AddDefaulted(c, "--pitch", w.pitch_deg, "the camera looks so far down [deg]; negative: up");
  without_number("4", "--hills", w.hills_m,
                 "town: its streets go up and down so far [m], every 150 m; without a number 4");
  without_number("4", "--noise", w.noise_sigma, "pixel noise [grey levels]; without a number 4");
  without_number("0.02", "--blur", w.motion_blur_s, "motion blur: exposure time [s]; without a number 0.02");
  without_number(
      "200", "--shake", w.shake_deg_per_s,
      "hand-held: fastest turning about each axis [deg/s], in bursts, on a lever of 0.2 m; without a "
      "number 200");
  without_number("0.03", "--readout", w.readout_s,
                 "rolling shutter: the last row is read so long after the first [s]; without a number 0.03");
  AddDefaulted(c, "--depth-delay", w.depth_delay_s,
               "rgbd: depth images are taken so long before the colour images they come with [s]");
  c.add_flag("--lighting-change", w.lighting_change, "another sun, darker, from the second lap on");
  c.add_flag("--dusk", w.dusk,
             "from the second lap on: dark, noisy, sun from elsewhere; town: lamps are lit");
  c.add_flag("--other-cars", w.other_cars, "town: other parked cars when places are seen again");
  without_number(
      "0.3", "--occlusion", w.occlusion,
      "town: from the second lap on, lorries cover so much of the image [0..0.3]; without a number 0.3");
  without_number("6", "--moving-objects", w.moving_objects,
                 "number of oncoming cars (indoors: people); without a number 6");
  c.add_flag("--kinect-noise", w.kinect_noise, "rgbd: depth noise and holes of a structured-light sensor");
  AddDefaulted(c, "--supersample", w.supersample,
               "samples per pixel and axis; 1 is fastest, with jagged edges");
  AddOption(c, "--threads", a.threads, "frames rendered at the same time; 0: as many as cores",
            NotNegative());
  AddPathOptions(c, a.path);
  c.add_flag("--force", a.force, "write into a folder that is not empty (its old frames are removed)");
  AddChangeOptions(c, a);
}

}  // namespace

void SetUpGenerate(CLI::App& command, int& exit_code) {
  command.footer(
      R"(Examples:
  tutti generate --out town --sensor stereo                         two laps of 315 m
  tutti generate --out block --sensor mono --blocks-x 1 --laps 1.3  a small loop, closed once
  tutti generate --out room --sensor rgbd --world room --kinect-noise
  tutti generate --out ring --sensor mono --world corridor --rate 1 --width 240 --height 192
  tutti generate --out hard --sensor stereo --noise --blur --lighting-change --moving-objects
  tutti generate --out flight --sensor stereo --trajectory body.tum --lens euroc --imu adis16448
  tutti generate --out dark --from-images kitchen/rgb --change dark:2 --change-from 250
The folder also gets a config.yaml: tutti run --config town/config.yaml --dataset town --out result)");
  auto arguments = std::make_shared<GenerateArguments>();
  AddOptions(command, *arguments);
  command.callback([arguments, &exit_code] { exit_code = Generate(*arguments); });
}

}  // namespace tutti::cli
