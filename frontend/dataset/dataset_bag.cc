// Bags of ROS with sensor_msgs/Image, CompressedImage and CameraInfo.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "frontend/dataset/bag.h"
#include "frontend/dataset/dataset_folder.h"
#include "frontend/dataset/ros_message.h"
#include "frontend/dataset/video_decoder.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

constexpr double kRosUnits = 1000;  // of 16-bit depth: millimetres (REP 118)

using Messages = std::vector<BagMessage>;

class BagDataset : public RecordedDataset {
 public:
  BagDataset(const fs::path& file, const DatasetOptions& options)
      : RecordedDataset(file.string(), options), bag_(Bag::Open(file)) {
    FindTopics();
    Index();
    if (!bag_->damage().empty()) warnings_.push_back(bag_->damage());
    FindRig();
  }

  std::size_t Size() const override { return frames_.size(); }
  double Stamp(std::size_t i) const override { return frames_.at(i).image->stamp_s; }
  double SkippedShare() const override { return skipped_share_; }

  ColourImage ReadColour(std::size_t i) const override {
    ColourImage result;
    try {
      result.image = ToColour(ReadPixels(*frames_.at(i).image, options_.topic, Pixels::kColour, rig_.left));
    } catch (const std::exception& e) {
      result.error = About(i) + ": " + e.what();
    }
    return result;
  }

  ReadResult Read(std::size_t i) const override {
    ReadResult result;
    try {
      const Frame& at = frames_.at(i);
      InputFrame frame;
      frame.index = Number(i);
      frame.stamp_s = at.image->stamp_s;
      frame.image = ReadPixels(*at.image, options_.topic, Pixels::kGrey, rig_.left);
      frame.mask = mask_;
      result.depth_error = AddOther(at, i, &frame);
      result.frame = std::move(frame);
    } catch (const std::exception& e) {
      result.error = About(i) + ": " + e.what();
    }
    return result;
  }

 private:
  struct Frame {
    const BagMessage *image = nullptr, *other = nullptr;  // other: null where there is none near in time
  };

  // The depth or right image, if there is one; or what is wrong with it.
  std::string AddOther(const Frame& at, std::size_t i, InputFrame* frame) const {
    if (at.other == nullptr) return {};
    try {
      if (options_.sensor == Sensor::kStereo)
        frame->right = ReadPixels(*at.other, other_topic_, Pixels::kGrey, rig_.right);
      else
        frame->depth_m = ReadDepth(*at.other);
      return {};
    } catch (const std::exception& e) {
      return About(i) + ": " + other_topic_ + ": " + e.what();
    }
  }

  void FindTopics() {
    std::vector<std::string> images;
    std::string list;
    for (const Bag::Topic& topic : bag_->topics()) {
      if (!IsImageMessage(topic.type)) continue;
      images.push_back(topic.name);
      list += " " + topic.name;
    }
    if (images.empty())
      throw InputError(name_ + ": holds no topic of sensor_msgs/Image or CompressedImage" +
                       (bag_->damage().empty() ? "" : "; it is damaged (" + bag_->damage() + ")"));
    if (options_.topic.empty() && images.size() == 1) options_.topic = images.front();
    const auto check = [&](const char* key, const std::string& topic) {
      if (std::find(images.begin(), images.end(), topic) != images.end()) return;
      throw InputError(
          name_ + ": " +
          (topic.empty() ? std::string("which images? Set ") : "has no images of '" + topic + "'; set ") +
          "dataset." + key + " to one of:" + list);
    };
    check("topic", options_.topic);
    if (options_.sensor == Sensor::kMono) return;
    const bool stereo = options_.sensor == Sensor::kStereo;
    other_topic_ = stereo ? options_.right_topic : options_.depth_topic;
    check(stereo ? "right_topic" : "depth_topic", other_topic_);
  }

  Messages Find(const std::string& topic) {
    Messages messages = bag_->Messages(topic);
    const std::size_t stored = messages.size();
    for (BagMessage& m : messages) {
      if (std::isnan(m.stamp_s)) m.stamp_s = StampOfPacked(m);
    }
    messages.erase(std::remove_if(messages.begin(), messages.end(),
                                  [](const BagMessage& m) { return std::isnan(m.stamp_s); }),
                   messages.end());
    const std::size_t all = stored + bag_->Lost(topic);
    if (messages.size() < all)
      Warn(PartText(all - messages.size(), all) + " images of " + topic + " can't be read and are skipped");
    return messages;
  }

  // The message is compressed; nan: it is damaged.
  double StampOfPacked(const BagMessage& message) const {
    MessageHead head = {};
    try {
      const std::string bytes = bag_->Read(message);
      if (bytes.size() >= sizeof head) std::memcpy(head.data(), bytes.data(), sizeof head);
      return bytes.size() >= sizeof head ? StampOf(head) : std::numeric_limits<double>::quiet_NaN();
    } catch (const InputError&) {
      return std::numeric_limits<double>::quiet_NaN();
    }
  }

  // Nobody set the stamps in the headers, but the recorder knows when it got the messages.
  static bool StampsAreConstant(const Messages& messages) {
    return messages.size() > 1 && messages.front().received_s < messages.back().received_s &&
           std::all_of(messages.begin(), messages.end(),
                       [&](const BagMessage& m) { return m.stamp_s == messages.front().stamp_s; });
  }

  void UseTimesOfReceipt() {
    const bool first = StampsAreConstant(images_);
    if (!first && !StampsAreConstant(others_)) return;
    Warn("all images of " + (first ? options_.topic : other_topic_) +
         " have the same stamp in their headers (" +
         std::to_string((first ? images_ : others_).front().stamp_s) +
         " s); the times at which they were recorded are used");
    for (Messages* messages : {&images_, &others_}) {
      for (BagMessage& m : *messages) m.stamp_s = m.received_s;
    }
  }

  // Without those that repeat a stamp. Throws InputError where the stamps go back.
  Messages InOrder(const Messages& messages, const std::string& topic) {
    Messages kept;
    for (const BagMessage& m : messages) {
      if (!kept.empty() && m.stamp_s < kept.back().stamp_s)
        throw InputError(StampsJumpBack(name_ + ": " + topic, kept.size(), kept.back().stamp_s, m.stamp_s));
      if (kept.empty() || m.stamp_s > kept.back().stamp_s) kept.push_back(m);
    }
    if (kept.size() < messages.size())
      Warn(PartText(messages.size() - kept.size(), messages.size()) + " images of " + topic +
           " repeat a time stamp and are skipped");
    const std::size_t all = bag_->Messages(topic).size() + bag_->Lost(topic);
    if (topic == options_.topic && !kept.empty())
      skipped_share_ = 1 - static_cast<double>(kept.size()) / static_cast<double>(all);
    return kept;
  }

  static const BagMessage* Nearest(const Messages& messages, double stamp_s, double limit_s) {
    const BagMessage* best = nullptr;
    const auto after = std::lower_bound(messages.begin(), messages.end(), stamp_s,
                                        [](const BagMessage& m, double s) { return m.stamp_s < s; });
    for (auto it = after == messages.begin() ? after : after - 1; it != messages.end() && it <= after; ++it) {
      if (std::abs(it->stamp_s - stamp_s) > limit_s) continue;
      if (best == nullptr || std::abs(it->stamp_s - stamp_s) < std::abs(best->stamp_s - stamp_s)) best = &*it;
    }
    return best;
  }

  void Index() {
    const bool mono = options_.sensor == Sensor::kMono, stereo = options_.sensor == Sensor::kStereo;
    images_ = Find(options_.topic);
    if (!mono) others_ = Find(other_topic_);
    UseTimesOfReceipt();
    images_ = InOrder(images_, options_.topic);
    others_ = InOrder(others_, other_topic_);
    std::size_t alone = 0;
    for (const BagMessage& image : images_) {
      frames_.push_back(
          {&image, Nearest(others_, image.stamp_s, stereo ? 0.0025 : options_.max_association_s)});
      if (frames_.back().other == nullptr) ++alone;
    }
    if (mono) return;
    const std::string what = stereo ? "right" : "depth";
    if (alone == frames_.size())
      throw InputError(name_ + ": no image of " + options_.topic + " has its " + what +
                       " image near it in time");
    if (alone > 0)
      Warn(PartText(alone, frames_.size()) + " images of " + options_.topic + " have no " + what +
           " image near them in time and are tracked without");
  }

  // The camera_info beside the images of a topic, of the size that they have.
  std::optional<CameraInfo> FindInfo(const std::string& images) {
    std::vector<std::string> levels = SplitText(images, "/");
    if (!levels.empty() && levels.back() == "compressed") levels.pop_back();
    if (!levels.empty()) levels.pop_back();
    levels.emplace_back("camera_info");
    const std::string topic = (images[0] == '/' ? "/" : "") + JoinText(levels, "/");
    const Bag::Topic* found = bag_->Find(topic);
    if (found == nullptr || found->type != "sensor_msgs/CameraInfo") return std::nullopt;
    const Messages infos = bag_->Messages(topic);
    if (infos.empty()) return std::nullopt;
    try {
      CameraInfo info = DecodeCameraInfo(bag_->Read(infos.front()), found->serialization, "the bag");
      if (!info.IsCalibrated()) return std::nullopt;
      std::string note = "calibration of " + topic;
      if (OfRectified(images) && info.P[0] > 0) note += ", P, as the images are rectified";
      if (!info.window.IsWhole()) {
        // Drivers that do not follow REP 104 state the size, and K, of the images that they send.
        const bool as_sent = info.width == size_.width && info.height == size_.height;
        note += ", " + info.window.Text() + (as_sent ? " in it already" : " applied");
        if (as_sent) info.window = {};
      }
      Warn(note);
      return info;
    } catch (const InputError& e) {
      throw InputError(name_ + ": " + topic + ": " + e.what());
    }
  }

  // "image_rect", "image_rect_color", ...: the calibration of such images is P, not K and D.
  static bool OfRectified(const std::string& images) {
    return images.find("image_rect") != std::string::npos;
  }

  PinholeCamera CameraOf(const CameraInfo& info, const std::string& images) const {
    const std::string source = name_ + ": camera_info of " + images;
    return Windowed(OfRectified(images) && info.P[0] > 0 ? info.Rectified() : info.Raw(source), info.window,
                    source);
  }

  // From the camera_info beside the images, unless the configuration has a camera.
  void FindCameras() {
    if (options_.camera) return;
    const std::optional<CameraInfo> left = FindInfo(options_.topic);
    if (!left) return;
    options_.camera = CameraOf(*left, options_.topic);
    if (options_.sensor != Sensor::kStereo || options_.right || options_.baseline_m > 0) return;
    const std::optional<CameraInfo> right = FindInfo(options_.right_topic);
    if (!right || !(left->P[0] > 0) || !(right->P[0] > 0)) return;  // RectifyRig says what is missing
    const double baseline_m = left->P[3] / left->P[0] - right->P[3] / right->P[0];
    if (baseline_m < 0)
      throw InputError(name_ + ": P of the camera_infos says that " + options_.right_topic +
                       " is the left camera; exchange dataset.topic and right_topic");
    if (OfRectified(options_.topic)) {
      options_.baseline_m = baseline_m;
      return;
    }
    if (baseline_m == 0) return;
    try {
      const Eigen::Matrix4d T = TransformOfRectified(left->R, right->R, baseline_m).Matrix();
      for (std::size_t i = 0; i < options_.T_right_left.size(); ++i)
        options_.T_right_left[i] = T(static_cast<int>(i) / 4, static_cast<int>(i) % 4);
    } catch (const InputError& e) {
      throw InputError(name_ + ": R of the camera_infos " + e.what() +
                       "; give both cameras with --calibration");
    }
    options_.right = CameraOf(*right, options_.right_topic);
  }

  void FindRig() {
    cv::Mat first;
    std::string error;
    for (std::size_t i = 0; i < std::min<std::size_t>(50, frames_.size()) && first.empty(); ++i) {
      try {
        first = Decode(*frames_[i].image, options_.topic, Pixels::kGrey).image;
      } catch (const InputError& e) {
        error = e.what();
      }
    }
    if (first.empty()) throw InputError(name_ + ": none of the first images can be read: " + error);
    size_ = first.size();
    range_ = RangeOf({first});
    if (range_.narrow) Warn(RangeText(range_));
    FindCameras();
    const double span = Stamp(frames_.size() - 1) - Stamp(0);
    SetUpRig(span > 0 ? static_cast<double>(frames_.size() - 1) / span : 10.0);
  }

  // An image of size_, once that is known. Throws InputError.
  MessageImage Decode(const BagMessage& message, const std::string& topic, Pixels pixels) const {
    const Bag::Topic& found = *bag_->Find(topic);  // FindTopics saw it
    MessageImage read = DecodeImageMessage(bag_->Read(message), found.type, found.serialization, pixels);
    if (read.image.empty()) throw InputError(read.error);
    if (!size_.empty() && read.image.size() != size_)
      throw InputError("an image has another size than the first one");
    return read;
  }

  // 8 bit, rectified.
  cv::Mat ReadPixels(const BagMessage& message, const std::string& topic, Pixels pixels,
                     const std::optional<Rectifier>& rectifier) const {
    const cv::Mat image = Decode(message, topic, pixels).image;
    if (image.depth() != CV_8U && image.depth() != CV_16U)
      throw InputError(topic + ": pixels are neither 8 nor 16 bit");
    return Rectified(rectifier, To8Bit(image, range_));
  }

  cv::Mat ReadDepth(const BagMessage& message) const {
    const MessageImage read = Decode(message, other_topic_, Pixels::kStored);
    if (read.image.channels() != 1) throw InputError(other_topic_ + ": is no depth image");
    const double units = read.metres ? 1.0 : DepthUnits(options_, kRosUnits);
    return Rectified(rig_.left, DepthInMetres(read.image, units, options_.max_depth_m), Sampling::kNearest);
  }

  double skipped_share_ = 0;
  GreyRange range_;
  std::unique_ptr<Bag> bag_;
  std::string other_topic_;  // of right or depth images; empty: mono
  Messages images_, others_;
  std::vector<Frame> frames_;
};

}  // namespace

std::unique_ptr<Dataset> OpenBag(const fs::path& file, const DatasetOptions& options) {
  return std::make_unique<BagDataset>(file, options);
}

}  // namespace tutti
