#include "frontend/odometry/camera_height.h"

#include <algorithm>
#include <cmath>

#include "core/numbers.h"

namespace tutti {
namespace {

constexpr double kWay = 0.4, kLongestWay = 1.5;  // between the two images [heights]
constexpr int kOldest = 10;                      // [frames]
constexpr double kWayOfDepth = 0.03;             // while the height is not known [depths]
constexpr int kWait = 10;                        // frames from one search to the next
constexpr double kFound = 0.85, kAgrees = 0.7;   // correlation of what is found, of what is known
constexpr double kTurned = 0.12;                 // of the ground against the camera [rad]
constexpr double kMisfit = 0.25;                 // of a logarithm: no measurement of the ground
// Standard deviation of a measurement, times the root of the distance between its images [heights]: errors of
// the road as well. Beyond kFarWay little of the ground is in both images: on kitti_00_head the heights over
// 0.6, 1.1 and 1.45 heights scatter by 2.6, 2.2 and 4.8 %.
constexpr double kSigma = 0.06, kFarWay = 1.2;
constexpr double kDirectWay = 0.6;  // beyond it, small images are aligned first
constexpr double kWalk = 0.003;     // of the drift, over a way of one height
constexpr int kMeasurements = 40, kMostFailures = 10, kOtherGrounds = 5, kMostChanges = 8;
constexpr double kOften = 0.6, kSpread = 0.1, kBias = 0.06;
constexpr double kMemory = 0.04;  // weight of the newest measurement in what holds "of late"
constexpr double kSpeedTime_s = 1.5,
                 kLongMemory_s = 10;  // of the newest speeds, and of what is known for long
constexpr int kFewestSpeeds = 5, kMostSpeeds = 60;
constexpr double kMoves = 0.2;      // [heights per second]
constexpr int kBiased = 8;          // measurements in a row
constexpr double kLeastJump = 0.1;  // of a logarithm, that the speed can tell from what drivers do
constexpr double kJump = 0.1;       // standard deviation of a drift that ran away
constexpr double kWorth = 0.002;    // a smaller drift waits

double SigmaOver(double way) { return kSigma / std::sqrt(way) * std::max(1.0, std::pow(way / kFarWay, 2)); }

// Where AlignGround begins over a long way, which moves the ground by many pixels: what it finds in images of
// about half the size, if that is a plane.
Eigen::Vector3d StartOf(const PinholeCamera& camera, const Pyramid& first, const Pyramid& second,
                        const Pose& T_second_first, const Eigen::Vector3d& plane) {
  for (std::size_t level = 0; level < first.Levels().size() && level < second.Levels().size(); ++level) {
    const cv::Mat& image = first.Levels()[level];
    const double scale = double(image.cols) / first.Levels().front().cols;
    if (scale > 0.55) continue;
    PinholeCamera small = camera;
    small.width = image.cols;
    small.height = image.rows;
    small.fx *= scale;
    small.fy *= scale;
    small.cx = (camera.cx + 0.5) * scale - 0.5;
    small.cy = (camera.cy + 0.5) * scale - 0.5;
    const auto found = AlignGround(small, image, second.Levels()[level], T_second_first, plane);
    return found && found->correlation > kAgrees ? found->normal_by_height : plane;
  }
  return plane;
}

double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::acos(std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0));
}

}  // namespace

void CameraHeight::See(const PinholeCamera& camera, const std::shared_ptr<const FrameFeatures>& features,
                       const Pose& T_camera_world, const Pose& T_last_world, double depth,
                       double interval_s) {
  if (!features->pyramid || features->pyramid->Levels().empty()) return;
  const auto begin = [&] {
    first_ = features;
    T_last_first_ = Pose();
    age_ = 0;
  };
  if (!first_) return begin();
  const Pose step = T_camera_world * T_last_world.Inverse();
  SeeSpeed(step.translation.norm(), interval_s);
  T_last_first_ = step * T_last_first_;
  for (const GroundAhead::Height& height : ahead_.Approach(step)) Take(height);
  ++age_;
  ++waited_;
  const double way = T_last_first_.translation.norm();
  const bool known = !plane_.isZero();
  const double least = known ? kWay / plane_.norm() : kWayOfDepth * depth;
  if (way < least) {
    if (age_ >= kOldest) begin();
    return;
  }
  if (known) {
    Measure(camera, *features);
  } else if (waited_ >= kWait) {
    Search(camera, *features);
    waited_ = 0;
  }
  begin();
}

void CameraHeight::Search(const PinholeCamera& camera, const FrameFeatures& now) {
  const cv::Mat &first = first_->pyramid->Levels().front(), &second = now.pyramid->Levels().front();
  std::optional<GroundPlane> found = SearchGround(camera, first, second, T_last_first_);
  if (!found || !(found->correlation > kFound - 0.15)) return;
  found = AlignGround(camera, first, second, T_last_first_, found->normal_by_height);
  if (!found || !(found->correlation > kFound)) return;
  const std::optional<Eigen::Vector3d> below = NormalBelow(T_last_first_);
  if (!below || !(AngleBetween(found->normal_by_height, *below) < 2 * kTurned)) return;
  // One that is known stays, unless it is another ground.
  const double height = std::log(found->Height()), by = Misfit(height);
  const bool same = seen_ > 0 && std::abs(by) < kMisfit;
  if (!same) {
    if (seen_ > 0 && ++others_ < kOtherGrounds) return;
    if (seen_ >= kMeasurements && ScaleChanged(by)) {
      drift_ += by;
      covariance_(1, 1) = kJump * kJump;
    } else {
      Learn(height);
    }
  }
  plane_ = found->normal_by_height;
  failures_ = others_ = 0;
}

void CameraHeight::Measure(const PinholeCamera& camera, const FrameFeatures& now) {
  const double way = T_last_first_.translation.norm() * plane_.norm();
  covariance_(1, 1) += kWalk * kWalk * way;
  if (way > kLongestWay) return;
  const Eigen::Vector3d start =
      way > kDirectWay ? StartOf(camera, *first_->pyramid, *now.pyramid, T_last_first_, plane_) : plane_;
  const auto found = AlignGround(camera, first_->pyramid->Levels().front(), now.pyramid->Levels().front(),
                                 T_last_first_, start);
  const double misfit = found ? Misfit(std::log(found->Height())) : 0;
  const bool agrees = found && found->correlation > kAgrees &&
                      AngleBetween(found->normal_by_height, plane_) < kTurned && std::abs(misfit) < kMisfit;
  ++seen_;
  const double weight = std::max(kMemory, 1.0 / seen_);
  share_ += weight * ((agrees ? 1 : 0) - share_);
  if (!agrees) {
    if (++failures_ >= kMostFailures) plane_.setZero();
    return;
  }
  failures_ = 0;
  plane_ += 0.2 * (found->normal_by_height - plane_);
  ahead_.Add(found->normal_by_height, T_last_first_, way);
}

void CameraHeight::Take(const GroundAhead::Height& height) {
  const double misfit = Misfit(height.log_height);
  if (!(std::abs(misfit) < kMisfit)) return;
  Update(misfit, height.way);
  biased_ = std::abs(bias_) > kBias ? biased_ + 1 : 0;
  if (seen_ < kMeasurements / 2 || biased_ < kBiased) return;  // until all known speeds are new
  if (ScaleChanged(misfit)) {
    covariance_(1, 1) = kJump * kJump;
    bias_ = 0;
    biased_ = 0;
    spread_ = kSigma * kSigma;
  } else {
    BeginAnew();
  }
}

void CameraHeight::SeeSpeed(double step, double interval_s) {
  if (seen_ == 0 || !(interval_s > 0) || !(step > kMoves * interval_s * std::exp(reference_ + drift_)))
    return;
  const double speed = std::log(step / interval_s);
  if (speeds_.empty()) known_speed_ = speed - drift_;
  const double newest = std::clamp(kSpeedTime_s / interval_s, double(kFewestSpeeds), double(kMostSpeeds));
  while (double(speeds_.size()) > newest - 1) speeds_.erase(speeds_.begin());
  speeds_.push_back(speed);
  if (failures_ == 0)
    known_speed_ += std::min(1.0, interval_s / kLongMemory_s) * (speed - drift_ - known_speed_);
}

// A scale that changes by this logarithm makes the camera faster as well as higher; one that rises goes on as
// fast as before.
bool CameraHeight::ScaleChanged(double by) const {
  if (speeds_.size() < std::size_t{kFewestSpeeds}) return false;
  std::vector<double> speeds = speeds_;
  const double faster = (internal::Median(speeds) - drift_ - known_speed_) / by;
  return std::abs(by) > kLeastJump && faster > 0.6 && faster < 1.6;
}

// What is measured runs away from what is expected: no scale drifts so fast, the camera rises or sinks.
void CameraHeight::BeginAnew() {
  const Eigen::Vector3d plane = plane_;
  changes_ = std::min(changes_ + 1, kMostChanges);
  Learn(-std::log(plane.norm()));
  plane_ = plane;
}

void CameraHeight::Learn(double log_height) {
  Forget();
  reference_ = log_height;
  covariance_(0, 0) = 1;
}

// Kalman filter; a misfit beyond twice what is usual counts as if it were so much.
void CameraHeight::Update(double misfit, double way) {
  const Eigen::RowVector2d by(1, 1);
  const double weight = std::max(kMemory, 1.0 / seen_);
  spread_ += weight * (misfit * misfit - spread_);
  bias_ += weight * (misfit - bias_);
  const double sigma = SigmaOver(way);
  const double variance = sigma * sigma * std::max(1.0, std::abs(misfit) / sigma);
  const Eigen::Vector2d gain = covariance_ * by.transpose() / (by * covariance_ * by.transpose() + variance);
  reference_ += gain(0) * misfit;
  drift_ += gain(1) * misfit;
  covariance_ -= Eigen::Matrix2d(gain * by * covariance_);
}

std::optional<double> CameraHeight::Drift() const {
  // Each time that the height was found to change, it must be seen to stay for twice as long.
  if (seen_ < (kMeasurements << changes_) || share_ < kOften || spread_ > kSpread * kSpread ||
      std::abs(bias_) > kBias)
    return std::nullopt;
  if (std::abs(drift_) < kWorth) return std::nullopt;
  return drift_;
}

void CameraHeight::Correct(double scale) {
  drift_ += std::log(scale);
  corrected_ += std::log(scale);
  ++corrections_;
  Scale(scale);
}

void CameraHeight::Scale(double scale) {
  for (double& speed : speeds_) speed += std::log(scale);
  plane_ /= scale;
  T_last_first_.translation *= scale;
  ahead_.Scale(scale);
}

void CameraHeight::Forget() {
  const int corrections = corrections_, changes = changes_;
  const double corrected = corrected_;
  *this = CameraHeight();
  changes_ = changes;
  corrections_ = corrections;
  corrected_ = corrected;
}

std::optional<HeightFound> CameraHeight::Found() const {
  if (seen_ == 0 && corrections_ == 0) return std::nullopt;
  return HeightFound{std::exp(reference_ + drift_), seen_, share_, corrections_, corrected_};
}

bool CameraHeight::IsPossible() const {
  return T_last_first_.IsFinite() && plane_.allFinite() && covariance_.allFinite() && age_ >= 0 &&
         waited_ >= 0 && ahead_.IsPossible() && seen_ >= 0 && failures_ >= 0 && others_ >= 0 &&
         biased_ >= 0 && changes_ >= 0 && changes_ <= kMostChanges && corrections_ >= 0 &&
         std::isfinite(corrected_) && speeds_.size() <= std::size_t{kMostSpeeds} &&
         std::all_of(speeds_.begin(), speeds_.end(), [](double v) { return std::isfinite(v); }) &&
         std::isfinite(known_speed_) && std::isfinite(reference_) && std::isfinite(drift_) &&
         std::isfinite(share_) && std::isfinite(spread_) && std::isfinite(bias_);
}

void CameraHeight::Rescale(double scale) {
  reference_ += std::log(scale);
  known_speed_ += std::log(scale);
  Scale(scale);
}

}  // namespace tutti
