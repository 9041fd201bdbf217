// ROS 1 bags with sensor_msgs/Image, CompressedImage and CameraInfo, through Debian's librosbag.
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <string_view>

#include "frontend/dataset/dataset_folder.h"
#include "frontend/dataset/video_input.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

/// A message and the time in its header.
struct StampedMessage {
  double stamp_s = 0;
  std::shared_ptr<const rosbag::MessageInstance> message;
};
using Messages = std::vector<StampedMessage>;

// librosbag believes every length: a damaged one of a record would end in 4 GB of memory. It believes those
// inside of records, too (SECURITY.md).
void CheckLengths(const fs::path& file) {
  constexpr std::string_view kMagic = "#ROSBAG V2.0\n";
  std::ifstream in;
  in.rdbuf()->pubsetbuf(nullptr, 0);  // four bytes here and there
  in.open(file, std::ios::binary);
  std::string magic(kMagic.size(), '\0');
  if (!in.read(magic.data(), static_cast<std::streamsize>(magic.size())) || magic != kMagic)
    return;  // librosbag says what it is
  std::error_code error;
  const std::uint64_t size = fs::file_size(file, error);
  for (std::uint64_t at = kMagic.size(), next = at; at < size; at = next) {
    for (int part = 0; part < 2; ++part) {  // a record's header, its data
      std::uint32_t length = 0;
      in.seekg(static_cast<std::streamoff>(next));
      in.read(reinterpret_cast<char*>(&length), sizeof length);
      next += sizeof length + length;
      if (!in || next > size) {
        throw InputError(file.string() + ": the record at byte " + std::to_string(at) +
                         " reaches beyond the file's end; repair it with 'rosbag reindex'");
      }
    }
  }
}

bool IsImage(const std::string& type) {
  return type == "sensor_msgs/Image" || type == "sensor_msgs/CompressedImage";
}

// The pixels of a raw image, without a copy; empty if the message is not whole or of an unknown encoding.
cv::Mat Pixels(const sensor_msgs::Image& image) {
  static const std::map<std::string, int> types = {
      {"mono8", CV_8UC1},       {"8UC1", CV_8UC1},        {"mono16", CV_16UC1},     {"16UC1", CV_16UC1},
      {"32FC1", CV_32FC1},      {"bgr8", CV_8UC3},        {"rgb8", CV_8UC3},        {"8UC3", CV_8UC3},
      {"bgra8", CV_8UC4},       {"rgba8", CV_8UC4},       {"bayer_rggb8", CV_8UC1}, {"bayer_bggr8", CV_8UC1},
      {"bayer_gbrg8", CV_8UC1}, {"bayer_grbg8", CV_8UC1}, {"bgr16", CV_16UC3},      {"rgb16", CV_16UC3}};
  const auto type = types.find(image.encoding);
  if (type == types.end() || image.width == 0 || image.height == 0 || image.is_bigendian != 0) return {};
  const std::size_t row = std::size_t{image.width} * static_cast<std::size_t>(CV_ELEM_SIZE(type->second));
  if (image.step < row || image.data.size() < std::size_t{image.step} * image.height) return {};
  return cv::Mat(static_cast<int>(image.height), static_cast<int>(image.width), type->second,
                 const_cast<unsigned char*>(image.data.data()), image.step);
}

// To one channel, 8 or 16 bit as it is. ROS names Bayer patterns by their first row, OpenCV by the second.
cv::Mat Grey(const cv::Mat& pixels, const std::string& encoding) {
  static const std::map<std::string, int> codes = {{"bgr8", cv::COLOR_BGR2GRAY},
                                                   {"8UC3", cv::COLOR_BGR2GRAY},
                                                   {"bgr16", cv::COLOR_BGR2GRAY},
                                                   {"rgb8", cv::COLOR_RGB2GRAY},
                                                   {"rgb16", cv::COLOR_RGB2GRAY},
                                                   {"bgra8", cv::COLOR_BGRA2GRAY},
                                                   {"rgba8", cv::COLOR_RGBA2GRAY},
                                                   {"bayer_rggb8", cv::COLOR_BayerBG2GRAY},
                                                   {"bayer_bggr8", cv::COLOR_BayerRG2GRAY},
                                                   {"bayer_gbrg8", cv::COLOR_BayerGR2GRAY},
                                                   {"bayer_grbg8", cv::COLOR_BayerGB2GRAY}};
  const auto code = codes.find(encoding);
  if (code == codes.end()) return pixels.clone();
  cv::Mat grey;
  cv::cvtColor(pixels, grey, code->second);
  return grey;
}

/// Every image of a topic as it is stored; `error` says why there is none.
cv::Mat DecodeMessage(const rosbag::MessageInstance& message, bool depth, bool* metres, std::string* error) {
  *metres = false;
  try {
    if (const auto image = message.instantiate<sensor_msgs::Image>()) {
      const cv::Mat pixels = Pixels(*image);
      if (pixels.empty())
        *error = "an image of encoding '" + image->encoding + "' can't be read, or is cut off";
      *metres = image->encoding == "32FC1";
      return pixels.empty() ? cv::Mat() : depth ? pixels.clone() : Grey(pixels, image->encoding);
    }
    if (const auto image = message.instantiate<sensor_msgs::CompressedImage>()) {
      cv::Mat pixels = cv::imdecode(
          image->data, depth ? cv::IMREAD_UNCHANGED : cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH);
      if (pixels.empty()) *error = "a compressed image ('" + image->format + "') can't be decoded";
      return pixels;
    }
    *error = "a message is no image";
  } catch (const ros::Exception& e) {
    *error = std::string("a message is damaged (") + e.what() + ")";
  }
  return {};
}

std::optional<PinholeCamera> CameraFrom(const sensor_msgs::CameraInfo& info, const std::string& name) {
  if (!(info.K[0] > 0)) return std::nullopt;  // not calibrated, says the standard
  PinholeCamera camera;
  camera.width = static_cast<int>(info.width);
  camera.height = static_cast<int>(info.height);
  camera.fx = info.K[0];
  camera.cx = info.K[2];
  camera.fy = info.K[4];
  camera.cy = info.K[5];
  const bool distorted = std::any_of(info.D.begin(), info.D.end(), [](double d) { return d != 0; });
  if (!distorted) return camera;
  if (info.distortion_model == "plumb_bob") {
    camera.distortion = Distortion::kRadTan;
  } else if (info.distortion_model == "equidistant" || info.distortion_model == "fisheye") {
    camera.distortion = Distortion::kEquidistant;
  } else {
    throw InputError(name + ": unknown distortion model '" + info.distortion_model +
                     "' in its camera_info; give the section camera: in the configuration");
  }
  for (std::size_t i = 0; i < std::min<std::size_t>(5, info.D.size()); ++i)
    camera.coefficients[i] = info.D[i];
  return camera;
}

class BagDataset : public Dataset {
 public:
  BagDataset(const fs::path& file, const DatasetOptions& options) : file_(file), options_(options) {
    CheckLengths(file);
    try {
      bag_.open(file.string(), rosbag::bagmode::Read);
      FindTopics();
      Index();
      SetUpRig();
    } catch (const ros::Exception& e) {
      throw InputError(file.string() + ": can't be read as a ROS bag (" + e.what() +
                       "); if it was cut off while recording, repair it with 'rosbag reindex'");
    }
  }

  std::size_t Size() const override { return frames_.size(); }
  double Stamp(std::size_t i) const override { return frames_.at(i).image->stamp_s; }
  const CameraRig& Rig() const override { return rig_; }
  std::optional<fs::path> GroundTruthFile() const override { return std::nullopt; }
  const std::vector<std::string>& Warnings() const override { return warnings_; }
  Trajectory ReadGroundTruth(const fs::path& file, std::vector<std::string>* warnings) const override {
    return ReadTrajectory(file, GuessTrajectoryFormat(file), warnings);
  }

  ReadResult Read(std::size_t i) const override {
    ReadResult result;
    try {
      const Frame& at = frames_.at(i);
      InputFrame frame;
      frame.index = Number(i);
      frame.stamp_s = at.image->stamp_s;
      frame.image = ReadGrey(*at.image, options_.topic);
      frame.mask = mask_;
      result.depth_error = AddDepth(at, i, &frame);
      result.frame = std::move(frame);
    } catch (const std::exception& e) {
      result.error = About(i) + e.what();
    }
    return result;
  }

 private:
  struct Frame {
    const StampedMessage *image = nullptr, *right = nullptr, *depth = nullptr;
  };

  std::string About(std::size_t i) const { return file_.string() + ": frame " + std::to_string(i) + ": "; }

  // The depth or right image, if there is one; or what is wrong with it.
  std::string AddDepth(const Frame& at, std::size_t i, InputFrame* frame) const {
    try {
      if (at.right != nullptr) frame->right = ReadGrey(*at.right, options_.right_topic);
      if (at.depth != nullptr) frame->depth_m = ReadDepth(*at.depth);
      return {};
    } catch (const std::exception& e) {
      return About(i) + (at.depth != nullptr ? options_.depth_topic : options_.right_topic) + ": " + e.what();
    }
  }

  // Topics that the options leave open, and all that are there for messages.
  void FindTopics() {
    std::vector<std::string> images;
    rosbag::View all(bag_);
    for (const rosbag::ConnectionInfo* connection : all.getConnections()) {
      if (IsImage(connection->datatype)) images.push_back(connection->topic);
    }
    std::sort(images.begin(), images.end());
    images.erase(std::unique(images.begin(), images.end()), images.end());
    std::string list;
    for (const std::string& topic : images) list += " " + topic;
    if (images.empty())
      throw InputError(file_.string() + ": holds no topic of sensor_msgs/Image or CompressedImage");
    if (options_.topic.empty() && images.size() == 1) options_.topic = images.front();
    const auto check = [&](const char* key, const std::string& topic) {
      if (std::find(images.begin(), images.end(), topic) != images.end()) return;
      throw InputError(
          file_.string() + ": " +
          (topic.empty() ? std::string("which images? Set ") : "has no images of '" + topic + "'; set ") +
          "dataset." + key + " to one of:" + list);
    };
    check("topic", options_.topic);
    if (options_.sensor == Sensor::kStereo) check("right_topic", options_.right_topic);
    if (options_.sensor == Sensor::kRgbd) check("depth_topic", options_.depth_topic);
  }

  // Messages of a topic by the stamps in their headers. A stamp is the second field of every header.
  Messages Find(const std::string& topic) {
    Messages messages;
    rosbag::View view(bag_, rosbag::TopicQuery(topic));
    std::vector<std::uint8_t> buffer;
    std::size_t damaged = 0;
    std::string damage;
    for (const rosbag::MessageInstance& message : view) {
      try {
        buffer.resize(message.size());
        ros::serialization::OStream stream(buffer.data(), static_cast<std::uint32_t>(buffer.size()));
        message.write(stream);
      } catch (const ros::Exception& e) {
        ++damaged;
        damage = e.what();
        continue;
      }
      if (buffer.size() < 12) continue;
      const auto word = [&](std::size_t at) {
        return double(buffer[at]) + 256.0 * buffer[at + 1] + 65536.0 * buffer[at + 2] +
               16777216.0 * buffer[at + 3];
      };
      messages.push_back(
          {word(4) + 1e-9 * word(8), std::make_shared<const rosbag::MessageInstance>(message)});
    }
    if (damaged > 0) {
      warnings_.push_back(file_.string() + ": " + std::to_string(damaged) + " of " +
                          std::to_string(messages.size() + damaged) + " images of " + topic +
                          " can't be read (" + damage + ") and are skipped");
    }
    const std::size_t all = messages.size();
    std::stable_sort(messages.begin(), messages.end(),
                     [](const StampedMessage& a, const StampedMessage& b) { return a.stamp_s < b.stamp_s; });
    Messages kept;
    for (const StampedMessage& m : messages) {
      if (kept.empty() || m.stamp_s > kept.back().stamp_s) kept.push_back(m);
    }
    if (kept.size() < all) {
      warnings_.push_back(file_.string() + ": " + std::to_string(all - kept.size()) + " of " +
                          std::to_string(all) + " images of " + topic +
                          " repeat a time stamp and are skipped");
    }
    return kept;
  }

  static const StampedMessage* Nearest(const Messages& messages, double stamp_s, double limit_s) {
    const StampedMessage* best = nullptr;
    const auto after = std::lower_bound(messages.begin(), messages.end(), stamp_s,
                                        [](const StampedMessage& m, double s) { return m.stamp_s < s; });
    for (auto it = after == messages.begin() ? after : after - 1; it != messages.end() && it <= after; ++it) {
      if (std::abs(it->stamp_s - stamp_s) > limit_s) continue;
      if (best == nullptr || std::abs(it->stamp_s - stamp_s) < std::abs(best->stamp_s - stamp_s)) best = &*it;
    }
    return best;
  }

  void Index() {
    images_ = Find(options_.topic);
    if (options_.sensor == Sensor::kStereo) right_ = Find(options_.right_topic);
    if (options_.sensor == Sensor::kRgbd) depth_ = Find(options_.depth_topic);
    std::size_t alone = 0;
    for (const StampedMessage& image : images_) {
      Frame frame;
      frame.image = &image;
      frame.right = Nearest(right_, image.stamp_s, 0.0025);
      frame.depth = Nearest(depth_, image.stamp_s, options_.max_association_s);
      if (frame.right == nullptr && frame.depth == nullptr) ++alone;
      frames_.push_back(frame);
    }
    if (options_.sensor == Sensor::kMono) return;
    const std::string what = options_.sensor == Sensor::kRgbd ? "depth" : "right";
    if (alone == frames_.size()) {
      throw InputError(file_.string() + ": no image of " + options_.topic + " has its " + what +
                       " image near it in time");
    }
    if (alone > 0) {
      warnings_.push_back(file_.string() + ": " + std::to_string(alone) + " of " +
                          std::to_string(frames_.size()) + " images of " + options_.topic + " have no " +
                          what + " image near them in time and are tracked without");
    }
  }

  // The camera_info beside the images, unless the configuration has a camera.
  void FindCamera() {
    if (options_.camera) return;
    const std::size_t slash = options_.topic.find_last_of('/');
    std::string base = slash == std::string::npos ? "" : options_.topic.substr(0, slash);
    if (options_.topic.size() > 11 && options_.topic.substr(slash) == "/compressed")
      base = base.substr(0, std::max<std::size_t>(1, base.find_last_of('/')));
    rosbag::View view(bag_, rosbag::TopicQuery(base + "/camera_info"));
    for (const rosbag::MessageInstance& message : view) {
      if (const auto info = message.instantiate<sensor_msgs::CameraInfo>()) {
        options_.camera = CameraFrom(*info, file_.string());
        if (options_.camera)
          warnings_.push_back(file_.string() + ": calibration of " + base + "/camera_info");
        return;
      }
    }
  }

  void SetUpRig() {
    FindCamera();
    cv::Mat first;
    std::string error;
    for (std::size_t i = 0; i < std::min<std::size_t>(50, frames_.size()) && first.empty(); ++i) {
      bool metres = false;
      first = DecodeMessage(*frames_[i].image->message, false, &metres, &error);
    }
    if (first.empty()) throw InputError(file_.string() + ": none of the first images can be read: " + error);
    size_ = first.size();
    bits_ = SignificantBits(first);
    const double span = Stamp(frames_.size() - 1) - Stamp(0);
    const double rate = span > 0 ? static_cast<double>(frames_.size() - 1) / span : 10.0;
    rig_ = SingleCameraRig(options_, size_, rate, file_.string(), rectifier_, warnings_);
    mask_ = SingleCameraMask(options_, size_, rectifier_);
    rig_.sensor = options_.sensor;
    rig_.max_depth_m = options_.max_depth_m;
    if (options_.sensor != Sensor::kStereo) return;
    if (options_.camera && options_.camera->distortion != Distortion::kNone)
      throw InputError(file_.string() +
                       ": stereo pairs of a bag must be rectified (image_rect); set distortion: none");
    if (!(options_.baseline_m > 0))
      throw InputError(file_.string() +
                       ": the distance of the two cameras is not known; set camera.baseline_m [m]");
    rig_.baseline_m = options_.baseline_m;
  }

  cv::Mat Fetch(const StampedMessage& message, bool depth, bool* metres) const {
    std::string error;
    cv::Mat image;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      image = DecodeMessage(*message.message, depth, metres, &error);
    }
    if (image.empty()) throw InputError(error);
    if (image.size() != size_) throw InputError("an image has another size than the first one");
    return image;
  }

  cv::Mat ReadGrey(const StampedMessage& message, const std::string& topic) const {
    bool metres = false;
    const cv::Mat image = Fetch(message, false, &metres);
    if (image.depth() != CV_8U && image.depth() != CV_16U)
      throw InputError(topic + ": pixels are neither 8 nor 16 bit");
    const cv::Mat grey = To8Bit(image, bits_);
    return rectifier_ ? rectifier_->Apply(grey) : grey;
  }

  cv::Mat ReadDepth(const StampedMessage& message) const {
    bool metres = false;
    const cv::Mat image = Fetch(message, true, &metres);
    if (image.channels() != 1) throw InputError(options_.depth_topic + ": is no depth image");
    cv::Mat depth = DepthInMetres(image, metres ? 1.0 : options_.depth_units_per_m, options_.max_depth_m);
    return rectifier_ ? rectifier_->Apply(depth, Sampling::kNearest) : depth;
  }

  fs::path file_;
  DatasetOptions options_;
  CameraRig rig_;
  cv::Size size_;
  int bits_ = 8;
  std::vector<std::string> warnings_;
  cv::Mat mask_;  // rectified; empty: none
  std::optional<Rectifier> rectifier_;
  mutable std::mutex mutex_;  // a bag reads from one place at a time
  rosbag::Bag bag_;
  Messages images_, right_, depth_;
  std::vector<Frame> frames_;
};

}  // namespace

std::unique_ptr<Dataset> OpenBag(const fs::path& file, const DatasetOptions& options) {
  return std::make_unique<BagDataset>(file, options);
}

}  // namespace tutti
