#include "data/synthetic/synthetic_world.h"

#include <algorithm>
#include <cmath>

#include "data/synthetic/given_path.h"
#include "data/synthetic/hills.h"
#include "data/synthetic/moving_camera.h"
#include "data/synthetic/scene.h"
#include "data/synthetic/synthetic_random.h"
#include "tutti/core/error.h"

namespace tutti {

using synthetic::Face;
using synthetic::Light;
using synthetic::Random;

std::string SyntheticOptions::Validate() const {
  const bool size_given = width != 0 || height != 0;
  if (size_given && (width < 32 || height < 32 || width > 8192 || height > 8192))
    return "width and height must both be given, 32 to 8192 pixels";
  if (!(focal_px == 0 || (focal_px >= 1 && focal_px <= 1e5)))
    return "focal_px must be 1 to 100000 pixels, or 0";
  if (!(baseline_m >= 0 && baseline_m <= 100)) return "baseline_m must be 0 to 100 m";
  if (!(rate_hz == 0 || (rate_hz >= 0.001 && rate_hz <= 10000)))
    return "rate_hz must be 0.001 to 10000 Hz, or 0";
  if (!(speed_mps == 0 || (speed_mps >= 0.001 && speed_mps <= 100)))
    return "speed_mps must be 0.001 to 100 m/s, or 0";
  if (!(max_depth_m >= 0 && max_depth_m <= 10000)) return "max_depth_m must be 0 to 10000 m";
  if (!(depth_units_per_m >= 0.001 && depth_units_per_m <= 1e6))
    return "depth_units_per_m must be 0.001 to 1000000";
  if (!(laps > 0 && laps <= 10000)) return "laps must be greater than 0 and at most 10000";
  if (frames < 0) return "frames must not be negative; 0 means all";
  if (blocks_x < 1 || blocks_y < 1 || blocks_x > 12 || blocks_y > 12)
    return "blocks_x and blocks_y must be 1 to 12";
  if (!(block_m >= 15 && block_m <= 200)) return "block_m must be 15 to 200 m";
  if (!(street_m >= 9 && street_m <= 30)) return "street_m must be 9 to 30 m";
  if (!(repeat_fraction >= 0 && repeat_fraction <= 1)) return "repeat_fraction must be 0 to 1";
  if (!(sign_fraction >= 0 && sign_fraction <= 1)) return "sign_fraction must be 0 to 1";
  if (facades < 5 || facades > 1000) return "facades must be 5 to 1000";
  if (road_surfaces < 1 || road_surfaces > 1000) return "road_surfaces must be 1 to 1000";
  if (!(bare_fraction >= 0 && bare_fraction <= 1)) return "bare_fraction must be 0 to 1";
  if (plain_doors < 0 || plain_doors > 4) return "plain_doors must be 0 to 4";
  if ((bare_fraction > 0 || plain_doors > 0) && scene != SyntheticScene::kRoom)
    return "bare_fraction and plain_doors are the room's alone";
  if (!(corridor_m >= 12 && corridor_m <= 500)) return "corridor_m must be 12 to 500 m";
  if (!(sides_deg > 0 && sides_deg <= 120)) return "sides_deg must be above 0 and at most 120 degrees";
  if (!(pitch_deg >= -45 && pitch_deg <= 45)) return "pitch_deg must be -45 to 45 degrees";
  if (!(hills_m >= 0 && hills_m <= 10)) return "hills_m must be 0 to 10 m";
  if (hills_m > 0 && scene != SyntheticScene::kTown) return "hills_m is the town's alone";
  if (!(noise_sigma >= 0 && noise_sigma <= 100)) return "noise_sigma must be 0 to 100 grey levels";
  if (!(motion_blur_s >= 0 && motion_blur_s <= 0.1)) return "motion_blur_s must be 0 to 0.1 s";
  if (!(readout_s >= 0 && readout_s <= 0.1)) return "readout_s must be 0 to 0.1 s";
  if (!(std::abs(depth_delay_s) <= 0.1)) return "depth_delay_s must be -0.1 to 0.1 s";
  if (!(shake_deg_per_s >= 0 && shake_deg_per_s <= 400)) return "shake_deg_per_s must be 0 to 400 deg/s";
  if (!(occlusion >= 0 && occlusion <= 0.3)) return "occlusion must be 0 to 0.3 of the image";
  if ((occlusion > 0 || other_cars) && scene != SyntheticScene::kTown)
    return "occlusion and other_cars are the town's alone";
  if (moving_objects < 0 || moving_objects > 100) return "moving_objects must be 0 to 100";
  if (supersample < 1 || supersample > 4) return "supersample must be 1 to 4";
  if (scene == SyntheticScene::kHall && !path) return "a hall is built around a path; give one";
  if (!path) return {};
  if (scene != SyntheticScene::kRoom && scene != SyntheticScene::kHall)
    return "a path leads through a room or a hall; the town's streets and the corridor have their own";
  if (sensor == SyntheticSensor::kSides) return "a path is rendered as mono, stereo or rgbd";
  if (readout_s > 0 || depth_delay_s != 0 || shake_deg_per_s > 0 || moving_objects > 0 || lighting_change ||
      dusk || bare_fraction > 0 || plain_doors > 0 || pitch_deg != 0)
    return "along a path there are no laps and no other motion: no readout, depth delay, shaking, moving "
           "objects, changes of light, curtains, doors, pitch";
  if (path->stamps_s.empty() || path->cameras.size() < (sensor == SyntheticSensor::kStereo ? 2U : 1U))
    return "the path has no frames, or not the cameras that the sensor needs";
  return {};
}

SyntheticOptions SyntheticOptions::Resolved() const {
  SyntheticOptions o = *this;
  const bool town = o.scene == SyntheticScene::kTown;
  const auto set = [](double& value, double otherwise) {
    if (value == 0) value = otherwise;
  };
  if (o.width == 0) o.width = 640;
  if (o.height == 0) o.height = town ? 320 : 480;
  set(o.focal_px, (town ? 0.58 : 0.82) * o.width);
  set(o.baseline_m, town ? 0.54 : 0.12);
  set(o.rate_hz, town ? 10 : 15);
  set(o.max_depth_m, town ? 13 : 8);
  set(o.speed_mps, town ? 8 : 0.5);
  return o;
}

struct SyntheticWorld::Impl {
  explicit Impl(const SyntheticOptions& o) : options(o), hand(o.seed, o.shake_deg_per_s), hills(o.hills_m) {}

  SyntheticOptions options;
  synthetic::Hand hand;
  synthetic::Hills hills;
  synthetic::Scene scene;
  PinholeCamera camera;
  std::size_t frames = 0;
  Pose T_scene_first;
  std::vector<double> parked_until;     // of each of scene.parking: way gone by the camera [m]
  std::vector<synthetic::Lens> lenses;  // of the path's cameras

  static constexpr double kDuskGain = 0.3;

  const synthetic::Route& Way() const { return scene.routes[0]; }

  // Camera in the scene's frame at a time. Smooth in time, so it may be asked between frames.
  Pose CameraAt(double t, double turned_left = 0) const {
    if (options.path) return options.path->spline.At(t) * options.path->cameras[0].T_body_camera;
    const Pose steady = SteadyCameraAt(t, turned_left);
    return options.shake_deg_per_s > 0 ? steady * hand.At(t) : steady;
  }

  Pose SteadyCameraAt(double t, double turned_left) const {
    const double s = Way().DistanceAt(t);
    // No lap runs in the tracks of the one before.
    const double unit = scene.eye_height / 1.65;  // a walker sways less than a car's lane is wide
    const double lateral = 0.3 * unit * std::sin(2 * M_PI * s / (0.73 * Way().Length()));
    const double heading = Way().HeadingAt(s);
    const Eigen::Vector2d point =
        Way().PointAt(s) + lateral * Eigen::Vector2d(-std::sin(heading), std::cos(heading));
    const double above =
        scene.eye_height + 0.015 * std::sin(2 * M_PI * 0.9 * t) + 0.01 * std::sin(2 * M_PI * 0.37 * t + 1);
    const double yaw = heading - scene.gaze_right + turned_left + scene.sway * std::sin(2 * M_PI * 0.21 * t);
    const double down = scene.gaze_down + options.pitch_deg * M_PI / 180 - hills.SlopeAt(point, yaw) +
                        scene.sway * std::sin(2 * M_PI * 0.43 * t + 0.7);
    const double roll =
        scene.sway * std::sin(2 * M_PI * 0.31 * t + 2.1) - hills.SlopeAt(point, yaw - M_PI / 2);
    Eigen::Matrix3d level;  // columns: right, down, forward of a camera that looks along yaw
    level << std::sin(yaw), 0, std::cos(yaw), -std::cos(yaw), 0, std::sin(yaw), 0, -1, 0;
    const Eigen::Quaterniond rotation = Eigen::Quaterniond(level) *
                                        Eigen::AngleAxisd(-down, Eigen::Vector3d::UnitX()) *
                                        Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ());
    return Pose(rotation.normalized(), hills.PointAt(point, above));
  }

  // As the spline and the world's own drive count: from the first pose.
  double TimeOf(std::size_t i) const {
    if (options.path) return options.path->stamps_s[i] - options.path->spline.Begin();
    return static_cast<double>(i) / options.rate_hz;
  }
  double StampOf(std::size_t i) const { return options.path ? options.path->stamps_s[i] : TimeOf(i); }

  // A cloud or the dusk comes within three seconds as the second lap begins: 0 before, 1 after.
  double ChangeAt(double t) const { return std::clamp((t - Way().LapTime()) / 3.0, 0.0, 1.0); }

  Light LightAt(double t) const {
    Light light;
    const double change = ChangeAt(t);
    if (options.dusk) {
      light.towards_sun =
          ((1 - change) * light.towards_sun + change * Eigen::Vector3d(-0.9, 0.3, 0.3)).normalized();
      light.gain += (kDuskGain - light.gain) * change;
      return light;
    }
    if (!options.lighting_change) return light;
    light.towards_sun =
        ((1 - change) * light.towards_sun + change * Eigen::Vector3d(-0.6, 0.5, 0.62)).normalized();
    light.ambient -= 0.15 * change;
    light.gain -= 0.28 * change;
    light.gamma += 0.2 * change;
    return light;
  }

  // The lamps' light on what is seen, which is as bright as its surface in daylight times light.gain.
  void LightLamps(synthetic::Rendering& view, const PinholeCamera& eye, const Pose& T_scene_camera,
                  double gain, double change) const {
    constexpr double kPower = 9;        // light of one at 1 m, of a daylight of 1
    constexpr double kReach = 14;       // [m]
    constexpr double kSight = 120;      // [m]
    std::vector<Eigen::Vector3f> near;  // in the camera frame
    const Pose T_camera_scene = T_scene_camera.Inverse();
    for (const Eigen::Vector3d& lamp : scene.lamps) {
      const Eigen::Vector3d seen = T_camera_scene * lamp;
      if (seen.z() > -kReach && seen.norm() < kSight) near.push_back(seen.cast<float>());
    }
    const float fx = static_cast<float>(eye.fx), fy = static_cast<float>(eye.fy);
    const float cx = static_cast<float>(eye.cx), cy = static_cast<float>(eye.cy);
    constexpr float kReach2 = static_cast<float>(kReach * kReach);
    for (int y = 0; y < view.image.rows; ++y) {
      for (int x = 0; x < view.image.cols; ++x) {
        const float z = view.depth_m.at<float>(y, x);
        if (z <= 0 || z > static_cast<float>(kSight)) continue;
        const Eigen::Vector3f p(z * (static_cast<float>(x) - cx) / fx, z * (static_cast<float>(y) - cy) / fy,
                                z);
        float sum = 0;
        for (const Eigen::Vector3f& lamp : near) {
          const float d2 = (lamp - p).squaredNorm();
          if (d2 < kReach2) sum += (1 - d2 / kReach2) / (0.15F + d2);
        }
        float& grey = view.image.at<float>(y, x);
        grey = std::min(255.0F, grey * (1 + static_cast<float>(kPower * change / gain) * sum));
      }
    }
  }

  void AddLorry(std::vector<Face>& faces, double s, double left, const Eigen::Vector3d& size,
                int look) const {
    const double heading = Way().HeadingAt(s);
    const Eigen::Vector2d at =
        Way().PointAt(s) + left * Eigen::Vector2d(-std::sin(heading), std::cos(heading));
    AppendBox(faces, {at.x(), at.y(), hills.HeightAt(at) + 0.01}, size, heading,
              scene.lorries[static_cast<std::size_t>(look) % scene.lorries.size()]);
  }

  // From the second lap on: a column of lorries comes the other way, and one drives ahead.
  void AddOcclusion(std::vector<Face>& faces, double t) const {
    const double begin = Way().LapTime(), length = Way().Length();
    if (options.occlusion <= 0 || t < begin) return;
    // Measured: a column without gaps covers kColumn of the image, the one ahead kAhead.
    constexpr double kColumn = 0.26, kAhead = 0.085, kSpeed = 4;
    const bool ahead = options.occlusion >= 0.1;
    const double dense = std::clamp((options.occlusion - (ahead ? kAhead : 0)) / kColumn, 0.02, 0.95);
    const double first = Way().DistanceAt(begin);
    Random random(options.seed * 0x2545F491ULL + 17);
    int look = 0;
    for (double s = 40; s < length - 12; ++look) {  // none pops up in view: the nearest comes from 40 m ahead
      const double height = random.In(3.3, 4.0), width = random.In(1.9, 2.2),
                   own_length = random.In(5.5, 7.5);
      AddLorry(faces, first + s - kSpeed * (t - begin), scene.mover_left + random.In(-0.1, 0.1),
               {own_length, width, height}, look);
      s += own_length / dense * random.In(0.9, 1.1);
    }
    if (!ahead) return;
    const double gap = 8 + 50 * std::exp(-(t - begin) / 3) + 1.5 * std::sin(2 * M_PI * 0.09 * (t - begin));
    AddLorry(faces, Way().DistanceAt(t) + gap + 3, 0, {6, 2.3, 3.4}, look);
  }

  // Half a lap after the camera passed a place, when it is out of sight, another car is parked there.
  std::vector<Face> ParkedAt(double t) const {
    if (scene.parking.empty()) return scene.faces;
    const double gone = Way().DistanceAt(t);
    std::vector<Face> faces;
    std::size_t next = 0;
    for (std::size_t k = 0; k < scene.parking.size(); ++k) {
      const synthetic::ParkingPlace& place = scene.parking[k];
      if (gone < parked_until[k]) continue;
      const auto at = [this](std::size_t i) { return scene.faces.begin() + static_cast<std::ptrdiff_t>(i); };
      faces.insert(faces.end(), at(next), at(place.first_face));
      faces.insert(faces.end(), place.later.begin(), place.later.end());
      next = place.first_face + place.faces;
    }
    faces.insert(faces.end(), scene.faces.begin() + static_cast<std::ptrdiff_t>(next), scene.faces.end());
    return faces;
  }

  // Way gone by the camera [m] when each parking place changes.
  void PlanParking() {
    for (const synthetic::ParkingPlace& place : scene.parking) {
      double nearest = 0, least = 1e300;
      for (double s = 0; s < Way().Length(); s += 1) {
        const double distance = (Way().PointAt(s) - place.at).norm();
        if (distance >= least) continue;
        least = distance;
        nearest = s;
      }
      parked_until.push_back(nearest + 0.5 * Way().Length());
    }
  }

  std::vector<Face> FacesAt(double t) const {
    std::vector<Face> faces = ParkedAt(t);
    AddOcclusion(faces, t);
    for (int k = 0; k < options.moving_objects; ++k) {
      const double spread = Way().Length() * (k + 0.4) / options.moving_objects;
      const double s = spread + scene.mover_speed * t;
      const double heading = Way().HeadingAt(s);
      const Eigen::Vector2d at =
          Way().PointAt(s) + scene.mover_left * Eigen::Vector2d(-std::sin(heading), std::cos(heading));
      const auto& look = scene.movers[static_cast<std::size_t>(k) % scene.movers.size()];
      AppendBox(faces, {at.x(), at.y(), hills.HeightAt(at) + 0.01}, scene.mover_size, heading, look);
    }
    return faces;
  }

  // What a camera sees at a time from a pose (in the scene), shifted by `right_m` along its x axis.
  synthetic::Rendering ViewFrom(const PinholeCamera& eye, Pose pose, double t, double right_m) const {
    pose.translation += pose.rotation * Eigen::Vector3d(right_m, 0, 0);
    const Light light = LightAt(t);
    synthetic::Rendering view =
        synthetic::Render(FacesAt(t), scene.textures, eye, pose, light, options.supersample);
    if (options.dusk && ChangeAt(t) > 0) LightLamps(view, eye, pose, light.gain, ChangeAt(t));
    return view;
  }

  // Samples of the exposure around t, an odd number: five, and of a shaken camera so many that what is seen 1
  // m away or more moves by at most kBlurStep from one to the next.
  int BlurSamples(double t) const {
    constexpr int kLeast = 5, kMost = 199;
    constexpr double kBlurStep = 2;  // [px]
    if (!(options.shake_deg_per_s > 0 || options.path) || !(options.motion_blur_s > 0)) return kLeast;
    const double half = 0.5 * options.motion_blur_s;
    const Pose moved = CameraAt(std::max(t + half, 0.0)).Inverse() * CameraAt(std::max(t - half, 0.0));
    double most = 0;
    for (const double u : {0.0, camera.width - 1.0}) {
      for (const double v : {0.0, camera.height - 1.0}) {
        const Eigen::Vector3d p = moved * camera.Unproject({u, v});
        if (p.z() < 0.1) return kMost;
        most = std::max(most, (camera.Project(p) - Eigen::Vector2d(u, v)).norm());
      }
    }
    return 2 * static_cast<int>(std::clamp(most / kBlurStep, double(kLeast), double(kMost)) / 2) + 1;
  }

  // What is exposed around t by a camera that is turned to the left [rad] and shifted by `right_m` along its
  // x axis.
  synthetic::Rendering View(double t, double right_m, double turned_left = 0) const {
    const synthetic::Shutter shutter{options.motion_blur_s, options.readout_s, BlurSamples(t)};
    return synthetic::Expose(camera, shutter, t, [&](const PinholeCamera& rows, double at) {
      return ViewFrom(rows, CameraAt(std::max(at, 0.0), turned_left), at, right_m);
    });
  }

  // The same through the lens of one of the path's cameras.
  synthetic::Rendering ViewAlongPath(double t, std::size_t which) const {
    const synthetic::GivenPath& path = *options.path;
    const synthetic::Shutter shutter{options.motion_blur_s, 0, BlurSamples(t)};
    return synthetic::Expose(camera, shutter, t, [&](const PinholeCamera&, double at) {
      return lenses[which].See(scene.faces, scene.textures,
                               path.spline.At(at) * path.cameras[which].T_body_camera, Light());
    });
  }

  // `dusk`: 0 by day, 1 at dusk, when the noise also grows with the light (shot noise of a short exposure).
  cv::Mat Sense(const cv::Mat& grey, std::uint64_t stream, double dusk) const {
    cv::Mat out(grey.size(), CV_8UC1);
    Random random(options.seed * 0x9E3779B1ULL + stream * 0xD1B54A32D192ED03ULL + 11);
    const float sigma = static_cast<float>(options.noise_sigma);
    for (int y = 0; y < grey.rows; ++y) {
      const float* in = grey.ptr<float>(y);
      std::uint8_t* row = out.ptr(y);
      for (int x = 0; x < grey.cols; ++x) {
        float value = sigma > 0 ? in[x] + sigma * random.Normal() : in[x];
        if (dusk > 0) value += std::sqrt(static_cast<float>(dusk) * (6 + 0.25F * in[x])) * random.Normal();
        row[x] = static_cast<std::uint8_t>(std::clamp(value + 0.5F, 0.0F, 255.0F));
      }
    }
    return out;
  }

  SyntheticFrame Frame(std::size_t i, const Pose& T_world_camera, const synthetic::Rendering& left,
                       const cv::Mat& right) const {
    SyntheticFrame frame;
    frame.stamp_s = StampOf(i);
    frame.T_world_camera = T_world_camera;
    const double dusk = options.dusk ? ChangeAt(TimeOf(i)) : 0;
    frame.image = Sense(left.image, 2 * i, dusk);
    if (!right.empty()) frame.right = Sense(right, 2 * i + 1, dusk);
    if (options.sensor == SyntheticSensor::kRgbd) {
      frame.depth_m = left.depth_m;
      if (options.depth_delay_s != 0)
        frame.depth_m = View(std::max(0.0, frame.stamp_s - options.depth_delay_s), 0).depth_m;
      if (options.kinect_noise) DepthNoise(frame.depth_m, i);
      const float limit =
          static_cast<float>(std::min(options.max_depth_m, 65535.0 / options.depth_units_per_m));
      frame.depth_m.setTo(0, frame.depth_m > limit);
    }
    return frame;
  }

  // Noise of a structured-light sensor: sigma_z = 0.0012 + 0.0019 (z - 0.4)^2 (Nguyen, Izadi, Lovell:
  // "Modeling Kinect sensor noise", 3DIMPVT 2012), shadows beside depth edges, and some holes.
  void DepthNoise(cv::Mat& depth, std::uint64_t stream) const {
    Random random(options.seed * 0xC2B2AE3DULL + stream * 0x9FB21C651E98DF25ULL + 5);
    const cv::Mat exact = depth.clone();
    for (int y = 0; y < depth.rows; ++y) {
      for (int x = 0; x < depth.cols; ++x) {
        const float z = exact.at<float>(y, x);
        if (z <= 0) continue;
        const float left = exact.at<float>(y, std::max(0, x - 3)),
                    right = exact.at<float>(y, std::min(depth.cols - 1, x + 3));
        const bool shadow = z - std::min(left, right) > 0.08F * z;
        float& out = depth.at<float>(y, x);
        if (shadow || z < 0.45F || random.Unit() < 0.01) {
          out = 0;
          continue;
        }
        out = z + (0.0012F + 0.0019F * (z - 0.4F) * (z - 0.4F)) * random.Normal();
      }
    }
  }
};

SyntheticWorld::SyntheticWorld(const SyntheticOptions& options) {
  const std::string problem = options.Validate();
  if (!problem.empty()) throw InputError("synthetic world: " + problem);
  impl_ = std::make_unique<Impl>(options.Resolved());
  const SyntheticOptions& o = impl_->options;
  if (o.path) {
    SetUpPath();
    return;
  }
  impl_->scene = o.scene == SyntheticScene::kTown   ? synthetic::BuildTown(o)
                 : o.scene == SyntheticScene::kRoom ? synthetic::BuildRoom(o)
                                                    : synthetic::BuildCorridor(o);
  impl_->hills.Lift(&impl_->scene.faces);
  for (synthetic::ParkingPlace& place : impl_->scene.parking) impl_->hills.Lift(&place.later);
  for (Eigen::Vector3d& lamp : impl_->scene.lamps) lamp.z() += impl_->hills.HeightAt(lamp.head<2>());
  impl_->PlanParking();
  PinholeCamera& c = impl_->camera;
  c.width = o.width;
  c.height = o.height;
  c.fx = c.fy = o.focal_px;
  c.cx = 0.5 * (o.width - 1);
  c.cy = 0.5 * (o.height - 1);
  const double all = std::floor(o.laps * impl_->Way().LapTime() * o.rate_hz) + 1;
  impl_->frames = static_cast<std::size_t>(all);
  if (o.frames > 0) impl_->frames = std::min(impl_->frames, static_cast<std::size_t>(o.frames));
  impl_->T_scene_first = impl_->CameraAt(0);
}

void SyntheticWorld::SetUpPath() {
  const SyntheticOptions& o = impl_->options;
  constexpr double kStep = 0.05;  // [s]
  std::vector<Eigen::Vector3d> way;
  for (double t = 0; t <= o.path->spline.Length(); t += kStep) {
    for (const synthetic::MountedCamera& c : o.path->cameras)
      way.push_back((o.path->spline.At(t) * c.T_body_camera).translation);
  }
  impl_->scene = synthetic::BuildSpaceAround(o, way);
  for (const synthetic::MountedCamera& c : o.path->cameras)
    impl_->lenses.emplace_back(c.camera, o.supersample);
  impl_->camera = o.path->cameras[0].camera;
  impl_->frames = o.path->stamps_s.size();
  if (o.frames > 0) impl_->frames = std::min(impl_->frames, static_cast<std::size_t>(o.frames));
}

SyntheticWorld::~SyntheticWorld() = default;
SyntheticWorld::SyntheticWorld(SyntheticWorld&&) noexcept = default;

const SyntheticOptions& SyntheticWorld::Options() const { return impl_->options; }
const PinholeCamera& SyntheticWorld::Camera() const { return impl_->camera; }
std::size_t SyntheticWorld::Size() const { return impl_->frames; }
double SyntheticWorld::Stamp(std::size_t i) const { return impl_->StampOf(i); }
double SyntheticWorld::LapLength() const { return impl_->Way().Length(); }
std::size_t SyntheticWorld::FramesPerLap() const {
  return static_cast<std::size_t>(impl_->Way().LapTime() * impl_->options.rate_hz);
}

Pose SyntheticWorld::PoseOf(std::size_t i) const {
  return i == 0 && !impl_->options.path ? Pose() : PoseAt(impl_->TimeOf(i));
}

Pose SyntheticWorld::PoseAt(double time_s) const {
  return impl_->T_scene_first.Inverse() * impl_->CameraAt(std::max(time_s, 0.0));
}

Trajectory SyntheticWorld::GroundTruth() const {
  Trajectory out;
  for (std::size_t i = 0; i < Size(); ++i) out.push_back({Stamp(i), PoseOf(i)});
  return out;
}

SyntheticFrame SyntheticWorld::Render(std::size_t i) const {
  const SyntheticOptions& o = impl_->options;
  if (o.path) {
    const double at = impl_->TimeOf(i);
    const bool stereo = o.sensor == SyntheticSensor::kStereo;
    return impl_->Frame(i, PoseOf(i), impl_->ViewAlongPath(at, 0),
                        stereo ? impl_->ViewAlongPath(at, 1).image : cv::Mat());
  }
  const double t = Stamp(i);
  const double side = o.sensor == SyntheticSensor::kSides ? o.sides_deg * M_PI / 180 : 0.0;
  const synthetic::Rendering left = impl_->View(t, 0, side);
  cv::Mat right;
  if (o.sensor == SyntheticSensor::kStereo) right = impl_->View(t, o.baseline_m).image;
  if (o.sensor == SyntheticSensor::kSides) right = impl_->View(t, 0, -side).image;
  return impl_->Frame(i, PoseOf(i), left, right);
}

SyntheticFrame SyntheticWorld::RenderFrom(std::size_t i, const Pose& T_world_camera) const {
  const Pose pose = impl_->T_scene_first * T_world_camera;
  const synthetic::Rendering left = impl_->ViewFrom(impl_->camera, pose, Stamp(i), 0);
  cv::Mat right;
  if (impl_->options.sensor == SyntheticSensor::kStereo)
    right = impl_->ViewFrom(impl_->camera, pose, Stamp(i), impl_->options.baseline_m).image;
  return impl_->Frame(i, T_world_camera, left, right);
}

std::vector<synthetic::Face> StillFaces(const SyntheticWorld& world) {
  std::vector<synthetic::Face> faces = world.impl_->scene.faces;
  const Pose T_world_scene = world.impl_->T_scene_first.Inverse();
  for (synthetic::Face& face : faces) {
    face.corner = T_world_scene * face.corner;
    face.edge_u = T_world_scene.rotation * face.edge_u;
    face.edge_v = T_world_scene.rotation * face.edge_v;
  }
  return faces;
}

cv::Mat SyntheticWorld::ExactDepth(std::size_t i) const {
  const double t = impl_->TimeOf(i);
  if (impl_->options.path) return impl_->ViewAlongPath(t, 0).depth_m;
  return impl_->ViewFrom(impl_->camera, impl_->CameraAt(t), t, 0).depth_m;
}

}  // namespace tutti
