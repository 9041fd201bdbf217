#include "frontend/dataset/ros_message.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/byte_stream.h"
#include "core/camera_text.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using internal::ByteReader;

// What is wrong with how a message is serialized; empty: nothing.
std::string SerializationProblem(std::string_view message, Serialization serialization) {
  if (serialization == Serialization::kRos1 || message.size() < 4) return {};
  if (message.substr(0, 2) == std::string_view("\x00\x01", 2)) return {};
  return "is not serialized as little-endian CDR";
}

// Values of a message, one after the other.
class MessageReader {
 public:
  MessageReader(std::string_view message, Serialization serialization, const std::string& source)
      : cdr_(serialization == Serialization::kCdr), in_(message, source) {
    if (cdr_) in_.GetView(4);  // the kind of serialization
    size_ = in_.Left();
  }

  template <typename T>
  T Get() {
    if (cdr_) in_.GetView((sizeof(T) - (size_ - in_.Left()) % sizeof(T)) % sizeof(T));
    return in_.Get<T>();
  }
  std::string_view Bytes() { return in_.GetView(Get<std::uint32_t>()); }
  std::string_view Text() {
    std::string_view text = Bytes();
    if (cdr_ && !text.empty() && text.back() == '\0') text.remove_suffix(1);
    return text;
  }
  void SkipHeader() {
    if (!cdr_) Get<std::uint32_t>();  // its number
    Get<std::uint32_t>();             // seconds
    Get<std::uint32_t>();             // nanoseconds
    Text();                           // the frame's name
  }

 private:
  bool cdr_;
  ByteReader in_;
  std::size_t size_ = 0;  // of what is aligned
};

/// How pixels of an encoding lie in memory, and how they become grey or colours; nothing to do: -1.
struct Encoding {
  int type, to_grey, to_colour;
};

// ROS names Bayer patterns by their first row, OpenCV by the second. "yuv422..." are old names.
const std::map<std::string, Encoding, std::less<>>& Encodings() {
  constexpr int kFromGrey = cv::COLOR_GRAY2BGR;
  static const std::map<std::string, Encoding, std::less<>> encodings = {
      {"mono8", {CV_8UC1, -1, kFromGrey}},
      {"8UC1", {CV_8UC1, -1, kFromGrey}},
      {"mono16", {CV_16UC1, -1, kFromGrey}},
      {"16UC1", {CV_16UC1, -1, kFromGrey}},
      {"32FC1", {CV_32FC1, -1, kFromGrey}},
      {"bgr8", {CV_8UC3, cv::COLOR_BGR2GRAY, -1}},
      {"8UC3", {CV_8UC3, cv::COLOR_BGR2GRAY, -1}},
      {"bgr16", {CV_16UC3, cv::COLOR_BGR2GRAY, -1}},
      {"rgb8", {CV_8UC3, cv::COLOR_RGB2GRAY, cv::COLOR_RGB2BGR}},
      {"rgb16", {CV_16UC3, cv::COLOR_RGB2GRAY, cv::COLOR_RGB2BGR}},
      {"bgra8", {CV_8UC4, cv::COLOR_BGRA2GRAY, cv::COLOR_BGRA2BGR}},
      {"bgra16", {CV_16UC4, cv::COLOR_BGRA2GRAY, cv::COLOR_BGRA2BGR}},
      {"rgba8", {CV_8UC4, cv::COLOR_RGBA2GRAY, cv::COLOR_RGBA2BGR}},
      {"rgba16", {CV_16UC4, cv::COLOR_RGBA2GRAY, cv::COLOR_RGBA2BGR}},
      {"bayer_rggb8", {CV_8UC1, cv::COLOR_BayerBG2GRAY, cv::COLOR_BayerBG2BGR}},
      {"bayer_bggr8", {CV_8UC1, cv::COLOR_BayerRG2GRAY, cv::COLOR_BayerRG2BGR}},
      {"bayer_gbrg8", {CV_8UC1, cv::COLOR_BayerGR2GRAY, cv::COLOR_BayerGR2BGR}},
      {"bayer_grbg8", {CV_8UC1, cv::COLOR_BayerGB2GRAY, cv::COLOR_BayerGB2BGR}},
      {"bayer_rggb16", {CV_16UC1, cv::COLOR_BayerBG2GRAY, cv::COLOR_BayerBG2BGR}},
      {"bayer_bggr16", {CV_16UC1, cv::COLOR_BayerRG2GRAY, cv::COLOR_BayerRG2BGR}},
      {"bayer_gbrg16", {CV_16UC1, cv::COLOR_BayerGR2GRAY, cv::COLOR_BayerGR2BGR}},
      {"bayer_grbg16", {CV_16UC1, cv::COLOR_BayerGB2GRAY, cv::COLOR_BayerGB2BGR}},
      {"uyvy", {CV_8UC2, cv::COLOR_YUV2GRAY_UYVY, cv::COLOR_YUV2BGR_UYVY}},
      {"yuv422", {CV_8UC2, cv::COLOR_YUV2GRAY_UYVY, cv::COLOR_YUV2BGR_UYVY}},
      {"yuyv", {CV_8UC2, cv::COLOR_YUV2GRAY_YUYV, cv::COLOR_YUV2BGR_YUYV}},
      {"yuv422_yuy2", {CV_8UC2, cv::COLOR_YUV2GRAY_YUYV, cv::COLOR_YUV2BGR_YUYV}}};
  return encodings;
}

void DecodeRaw(MessageReader& in, Pixels pixels, MessageImage* out) {
  const auto height = in.Get<std::uint32_t>(), width = in.Get<std::uint32_t>();
  const std::string_view encoding = in.Text();
  const bool big_endian = in.Get<std::uint8_t>() != 0;
  const std::size_t step = in.Get<std::uint32_t>();
  const std::string_view data = in.Bytes();
  const auto known = Encodings().find(encoding);
  if (known == Encodings().end() || (big_endian && CV_ELEM_SIZE1(known->second.type) > 1)) {
    out->error = "an image of encoding '" + std::string(encoding) + "'" +
                 (big_endian ? ", big-endian," : "") + " can't be read";
    return;
  }
  const int type = known->second.type;
  if (CV_MAT_CN(type) == 2 && width % 2 != 0) {  // OpenCV would go beyond the row
    out->error = "an image of encoding '" + std::string(encoding) +
                 "' has an odd width, and two pixels share a colour";
    return;
  }
  if (width == 0 || height == 0 || std::uint64_t{width} * height > kMostImagePixels ||
      step < std::size_t{width} * static_cast<std::size_t>(CV_ELEM_SIZE(type)) ||
      data.size() / step < height) {
    out->error = "an image says that it has " + std::to_string(width) + " x " + std::to_string(height) +
                 " pixels, and its " + std::to_string(data.size()) + " bytes are not that";
    return;
  }
  const cv::Mat stored(static_cast<int>(height), static_cast<int>(width), type,
                       const_cast<char*>(data.data()), step);
  out->metres = encoding == "32FC1";
  const int change = pixels == Pixels::kGrey     ? known->second.to_grey
                     : pixels == Pixels::kColour ? known->second.to_colour
                                                 : -1;
  if (change < 0) {
    out->image = stored.clone();
  } else {
    cv::cvtColor(stored, out->image, change);
  }
}

// Depth as compressed_depth_image_transport packs it: three numbers (a kind, two of the quantization), then a
// PNG. Metres become inverse depths of 16 bit: A / (value - B).
void DecodeCompressedDepth(const std::string& format, std::string_view data, MessageImage* out) {
  constexpr std::size_t kHead = 12;
  if (data.size() < kHead || format.find("rvl") != std::string::npos) {
    out->error = "a compressed depth image ('" + format + "') can't be read; record it as png";
    return;
  }
  std::array<float, 2> quantization;
  std::memcpy(quantization.data(), data.data() + 4, sizeof quantization);
  data.remove_prefix(kHead);
  const ImageFile decoded = DecodeImage({data.begin(), data.end()}, cv::IMREAD_UNCHANGED);
  out->image = decoded.image;
  if (!decoded.error.empty()) out->error = "a compressed depth image ('" + format + "') " + decoded.error;
  if (format.compare(0, 5, "32FC1") != 0 || decoded.image.type() != CV_16UC1) return;
  const auto [a, b] = quantization;
  out->image = cv::Mat(decoded.image.size(), CV_32FC1);
  out->metres = true;
  for (int y = 0; y < decoded.image.rows; ++y) {
    for (int x = 0; x < decoded.image.cols; ++x) {
      const auto value = decoded.image.at<std::uint16_t>(y, x);
      out->image.at<float>(y, x) = value > 0 ? a / (static_cast<float>(value) - b) : 0.0F;
    }
  }
}

void DecodeCompressed(MessageReader& in, Pixels pixels, MessageImage* out) {
  const std::string format(in.Text());
  const std::string_view data = in.Bytes();
  if (format.find("compressedDepth") != std::string::npos) return DecodeCompressedDepth(format, data, out);
  const int channels = pixels == Pixels::kGrey ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR;
  const ImageFile decoded =
      DecodeImage({data.begin(), data.end()},
                  pixels == Pixels::kStored ? cv::IMREAD_UNCHANGED
                                            : channels | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
  out->image = decoded.image;
  if (!decoded.error.empty()) out->error = "a compressed image ('" + format + "') " + decoded.error;
}

}  // namespace

double StampOf(const MessageHead& head) {
  if (IsPacked({reinterpret_cast<const char*>(head.data()), sizeof head}))
    return std::numeric_limits<double>::quiet_NaN();
  return head[1] + 1e-9 * head[2];
}

bool IsPacked(std::string_view bytes) { return bytes.substr(0, 4) == "\x28\xb5\x2f\xfd"; }

std::string NameOfType(std::string type) {
  const std::size_t msg = type.find("/msg/");
  if (msg != std::string::npos) type.erase(msg, 4);
  return type;
}

bool IsImageMessage(const std::string& type) {
  return type == "sensor_msgs/Image" || type == "sensor_msgs/CompressedImage";
}

MessageImage DecodeImageMessage(const std::string& message, const std::string& type,
                                Serialization serialization, Pixels pixels) {
  MessageImage out;
  out.error = SerializationProblem(message, serialization);
  if (!out.error.empty()) {
    out.error = "a message " + out.error;
    return out;
  }
  try {
    MessageReader in(message, serialization, "a message");
    in.SkipHeader();
    type == "sensor_msgs/Image" ? DecodeRaw(in, pixels, &out) : DecodeCompressed(in, pixels, &out);
  } catch (const InputError&) {
    out.error = "a message is damaged: it ends too early";
  } catch (const std::exception& e) {  // of OpenCV, and no memory
    out.image.release();
    out.error = e.what();
  }
  return out;
}

CameraInfo DecodeCameraInfo(const std::string& message, Serialization serialization,
                            const std::string& source) {
  const std::string problem = SerializationProblem(message, serialization);
  if (!problem.empty()) throw InputError(source + ": a camera_info " + problem);
  MessageReader in(message, serialization, source + ": a camera_info");
  in.SkipHeader();
  const auto pixels = [&] { return internal::PixelsOf(in.Get<std::uint32_t>()); };
  CameraInfo info;
  info.height = pixels();
  info.width = pixels();
  info.model = in.Text();
  constexpr std::uint32_t kMostTerms = 100;
  const auto count = in.Get<std::uint32_t>();
  if (count > kMostTerms)
    throw InputError(source + ": a camera_info has " + std::to_string(count) + " coefficients");
  for (std::uint32_t i = 0; i < count; ++i) info.lens.push_back(in.Get<double>());
  for (double& value : info.K) value = in.Get<double>();
  for (double& value : info.R) value = in.Get<double>();
  for (double& value : info.P) value = in.Get<double>();
  ImageWindow& window = info.window;
  for (int* value : {&window.binning_x, &window.binning_y, &window.x_offset, &window.y_offset, &window.height,
                     &window.width})
    *value = pixels();
  return info;
}

ImuSample DecodeImuMessage(const std::string& message, Serialization serialization,
                           const std::string& source) {
  const std::string problem = SerializationProblem(message, serialization);
  if (!problem.empty()) throw InputError(source + ": a measurement " + problem);
  MessageReader in(message, serialization, source + ": a measurement");
  in.SkipHeader();
  constexpr int kOrientation = 4, kCovariance = 9;
  const auto skip = [&](int count) {
    for (int i = 0; i < count; ++i) in.Get<double>();
  };
  ImuSample sample;
  skip(kOrientation + kCovariance);
  for (double& value : sample.gyro) value = in.Get<double>();
  skip(kCovariance);
  for (double& value : sample.acceleration) value = in.Get<double>();
  return sample;
}

}  // namespace tutti
