// tutti generate: renders the synthetic world to disk, or changes real images.
#include <algorithm>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "apps/run/interrupt.h"
#include "apps/run/progress.h"
#include "apps/tutti/changed_images.h"
#include "apps/tutti/checks.h"
#include "apps/tutti/commands.h"
#include "core/terminal.h"
#include "data/synthetic/synthetic_world.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

struct GenerateArguments {
  std::string out, sensor, scene = "town";
  SyntheticOptions world;
  std::string from_images, change;  // the first empty: a synthetic world
  int stride = 1, change_from = 0;
  int threads = 0;
  bool force = false;

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

int ChangeImages(const GenerateArguments& arguments) {
  const ImageChange change = ImageChange::Parse(arguments.change);
  ChangedImagesOptions o;
  o.from = arguments.from_images;
  o.out = arguments.out;
  o.stride = arguments.stride;
  o.change_from = arguments.change_from;
  o.seed = arguments.world.seed;
  o.threads = arguments.Threads();
  o.force = arguments.force;
  std::optional<Progress> progress;
  o.progress = ReportTo(progress);
  const InterruptGuard guard;
  const ChangedImages result = WriteChangedImages(change, o);
  for (const std::string& note : result.notes) internal::Say("%s", note.c_str());
  const char* d = arguments.out.c_str();
  if (result.written < result.taken) {
    internal::Say("interrupted: %s holds the first %zu of %zu images and can be used", d, result.written,
                  result.taken);
    return 130;
  }
  std::printf("%s: %zu images, changed by %s:%d", d, result.written, change.Name().c_str(),
              change.Strength());
  if (o.change_from > 0) std::printf(" from image %d on (counted from 0)", o.change_from);
  std::printf(
      ". Next, with the ground truth of the images they are from:\n  tutti loops --images %s --ground-truth "
      "FILE --out %s_loops\n",
      d, d);
  return 0;
}

int Generate(const GenerateArguments& arguments) {
  if (!arguments.from_images.empty()) return ChangeImages(arguments);
  if (arguments.sensor.empty()) throw CLI::RequiredError("--sensor (or --from-images)");
  SyntheticOptions wanted = arguments.world;
  wanted.scene = arguments.scene == "room"       ? SyntheticScene::kRoom
                 : arguments.scene == "corridor" ? SyntheticScene::kCorridor
                                                 : SyntheticScene::kTown;
  wanted.sensor = arguments.sensor == "rgbd"     ? SyntheticSensor::kRgbd
                  : arguments.sensor == "stereo" ? SyntheticSensor::kStereo
                  : arguments.sensor == "sides"  ? SyntheticSensor::kSides
                                                 : SyntheticSensor::kMono;
  const SyntheticWorld world(wanted);
  const SyntheticOptions& o = world.Options();
  internal::Say("%zu frames of %dx%d, %.0f m a lap (%zu frames), into %s", world.Size(), o.width, o.height,
                world.LapLength(), world.FramesPerLap(), arguments.out.c_str());
  SyntheticWriteOptions write;
  write.force = arguments.force;
  write.threads = arguments.Threads();
  std::optional<Progress> progress;
  write.progress = ReportTo(progress);
  const InterruptGuard guard;
  const std::size_t written = WriteSyntheticDataset(world, arguments.out, write);
  const char* d = arguments.out.c_str();
  if (written < world.Size()) {
    internal::Say("interrupted: %s holds the first %zu of %zu frames and can be used", d, written,
                  world.Size());
    return 130;
  }
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
  c.add_option("--stride", a.stride, "with --from-images: take one of so many images")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str()
      ->needs(from);
  c.add_option(
       "--change-from", a.change_from,
       "with --from-images: copy the images before this one as they are; counted from 0, after --stride")
      ->check(NotNegative())
      ->capture_default_str()
      ->needs(from);
}

void AddOptions(CLI::App& c, GenerateArguments& a) {
  SyntheticOptions& w = a.world;
  c.add_option("--out", a.out, "folder to write; made if missing, must be empty")
      ->required()
      ->type_name("DIR");
  c.add_option(
       "--sensor", a.sensor,
       "mono, stereo (both in the KITTI layout), rgbd (TUM layout) or sides (pairs that look left and right)")
      ->check(CLI::IsMember({"mono", "stereo", "rgbd", "sides"}))
      ->type_name("NAME");
  c.add_option(
       "--world", a.scene,
       "town: streets driven through; room: furnished, walked around in; corridor: plain walls and doors")
      ->check(CLI::IsMember({"town", "room", "corridor"}))
      ->type_name("NAME")
      ->capture_default_str();
  c.add_option("--seed", w.seed, "of houses, textures and noise; the same seed gives the same bytes")
      ->check(NotNegative())
      ->capture_default_str();
  c.add_option("--laps", w.laps,
               "rounds of the closed route (fractions too); from the second on, places are seen again")
      ->capture_default_str();
  c.add_option("--frames", w.frames, "stop after so many frames; 0: all laps")
      ->check(NotNegative())
      ->capture_default_str();
  c.add_option("--width", w.width, "image width [px] (with --height; default 640)");
  c.add_option("--height", w.height, "image height [px] (default: town 320, else 480)");
  c.add_option("--focal", w.focal_px, "focal length [px] (default: town 0.58, else 0.82 of the width)");
  c.add_option("--baseline", w.baseline_m,
               "stereo: distance of the cameras [m] (default: town 0.54, else 0.12)");
  c.add_option("--rate", w.rate_hz, "frames per second (default: town 10, else 15)");
  c.add_option("--speed", w.speed_mps, "on straights [m/s] (default: town 8, else 0.5)");
  c.add_option("--blocks-x", w.blocks_x, "town: blocks of houses that the route goes around, in x")
      ->capture_default_str();
  c.add_option("--blocks-y", w.blocks_y, "town: and in y (2 or more in both: an L)")->capture_default_str();
  c.add_option("--block", w.block_m, "town: side of a block [m]")->capture_default_str();
  c.add_option("--repeat", w.repeat_fraction,
               "aliasing [0..1]: part of the houses (corridor: plates, posters) that look alike")
      ->capture_default_str();
  c.add_option("--facades", w.facades,
               "town: number of facades that differ (of cars a quarter); few are aliasing, too")
      ->capture_default_str();
  c.add_option("--signs", w.sign_fraction, "town: part of the signs that are there [0..1]; no two look alike")
      ->capture_default_str();
  c.add_option("--roads", w.road_surfaces, "town: number of road surfaces that differ; few are aliasing, too")
      ->capture_default_str();
  c.add_option("--corridor", w.corridor_m, "corridor: longer side of the ring [m]; the other is half of it")
      ->capture_default_str();
  c.add_option("--sides", w.sides_deg, "sensor sides: each camera looks so far from the way [deg]")
      ->capture_default_str();
  c.add_option("--pitch", w.pitch_deg, "the camera looks so far down [deg]; negative: up")
      ->capture_default_str();
  c.add_option("--hills", w.hills_m,
               "town: its streets go up and down so far [m], every 150 m; without a number 4")
      ->expected(0, 1)
      ->default_str("4");
  c.add_option("--noise", w.noise_sigma, "pixel noise [grey levels]; without a number 4")
      ->expected(0, 1)
      ->default_str("4");
  c.add_option("--blur", w.motion_blur_s, "motion blur: exposure time [s]; without a number 0.02")
      ->expected(0, 1)
      ->default_str("0.02");
  c.add_option(
       "--shake", w.shake_deg_per_s,
       "hand-held: fastest turning about each axis [deg/s], in bursts, on a lever of 0.2 m; without a "
       "number 200")
      ->expected(0, 1)
      ->default_str("200");
  c.add_option("--readout", w.readout_s,
               "rolling shutter: the last row is read so long after the first [s]; without a number 0.03")
      ->expected(0, 1)
      ->default_str("0.03");
  c.add_flag("--lighting-change", w.lighting_change, "another sun, darker, from the second lap on");
  c.add_flag("--dusk", w.dusk,
             "from the second lap on: dark, noisy, sun from elsewhere; town: lamps are lit");
  c.add_flag("--other-cars", w.other_cars, "town: other parked cars when places are seen again");
  c.add_option(
       "--occlusion", w.occlusion,
       "town: from the second lap on, lorries cover so much of the image [0..0.3]; without a number 0.3")
      ->expected(0, 1)
      ->default_str("0.3");
  c.add_option("--moving-objects", w.moving_objects,
               "number of oncoming cars (indoors: people); without a number 6")
      ->expected(0, 1)
      ->default_str("6");
  c.add_flag("--kinect-noise", w.kinect_noise, "rgbd: depth noise and holes of a structured-light sensor");
  c.add_option("--supersample", w.supersample, "samples per pixel and axis; 1 is fastest, with jagged edges")
      ->capture_default_str();
  c.add_option("--threads", a.threads, "frames rendered at the same time; 0: as many as cores")
      ->check(NotNegative());
  c.add_flag("--force", a.force, "write into a folder that is not empty (its old frames are removed)");
  AddChangeOptions(c, a);
}

}  // namespace

void SetUpGenerate(CLI::App& command, int& exit_code) {
  command.footer(
      "Examples:\n"
      "  tutti generate --out town --sensor stereo                         two laps of 315 m\n"
      "  tutti generate --out block --sensor mono --blocks-x 1 --laps 1.3  a small loop, closed once\n"
      "  tutti generate --out room --sensor rgbd --world room --kinect-noise\n"
      "  tutti generate --out ring --sensor mono --world corridor --rate 1 --width 240 --height 192\n"
      "  tutti generate --out hard --sensor stereo --noise --blur --lighting-change --moving-objects\n"
      "  tutti generate --out dark --from-images kitchen/rgb --change dark:2 --change-from 250\n"
      "The folder also gets a config.yaml: tutti run --config town/config.yaml --dataset town --out result");
  auto arguments = std::make_shared<GenerateArguments>();
  AddOptions(command, *arguments);
  command.callback([arguments, &exit_code] { exit_code = Generate(*arguments); });
}

}  // namespace tutti::cli
