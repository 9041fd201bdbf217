// Writes ROS 1 bags of format 2.0 and messages into them, for tests and seeds of the fuzzer.
#pragma once

#include <bzlib.h>
#include <lz4frame.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/byte_stream.h"
#include "frontend/dataset/camera_info.h"
#include "tutti/core/imu.h"

namespace tutti::testing {

enum class BagPacking { kPlain, kBz2, kLz4 };

class BagWriter {
 public:
  /// A chunk is closed once it has `chunk_bytes`.
  explicit BagWriter(BagPacking packing = BagPacking::kPlain, std::size_t chunk_bytes = 1)
      : packing_(packing), chunk_bytes_(chunk_bytes) {
    file_.PutRaw("#ROSBAG V2.0\n", 13);
    Record(file_, {Op(3), Field<std::uint64_t>("index_pos", 0)}, "");
  }

  void Write(const std::string& topic, const std::string& type, const std::string& message,
             double received_s = 0) {
    const auto [at, is_new] = connections_.emplace(topic, connections_.size());
    const auto id = static_cast<std::uint32_t>(at->second);
    if (is_new) {
      Record(chunk_, {Op(7), Field("conn", id), "topic=" + topic},
             Fields({"topic=" + topic, "type=" + type, "message_definition="}));
    }
    counts_[id]++;
    const auto seconds = static_cast<std::uint64_t>(received_s);
    const auto nanoseconds =
        static_cast<std::uint64_t>(std::lround(1e9 * (received_s - static_cast<double>(seconds))));
    Record(chunk_, {Op(2), Field("conn", id), Field("time", nanoseconds << 32U | seconds)}, message);
    if (chunk_.bytes().size() >= chunk_bytes_) CloseChunk();
  }

  /// The bytes of the file; with `cut`, as they are on disk while the last chunk is still open.
  std::string Finish(bool cut = false) {
    if (cut) {
      Record(file_, {Op(5), "compression=none", Field<std::uint32_t>("size", 0)}, "");
      file_.PutRaw(chunk_.bytes().data(), chunk_.bytes().size());
    } else {
      CloseChunk();
    }
    return file_.Take();
  }

 private:
  using Bytes = internal::ByteWriter;

  static std::string Op(char op) { return std::string("op=") + op; }
  template <typename T>
  static std::string Field(const std::string& name, T value) {
    Bytes out;
    out.Put(value);
    return name + "=" + out.Take();
  }
  static std::string Fields(const std::vector<std::string>& fields) {
    Bytes out;
    for (const std::string& field : fields) {
      out.Put(static_cast<std::uint32_t>(field.size()));
      out.PutRaw(field.data(), field.size());
    }
    return out.Take();
  }
  static void Record(Bytes& to, const std::vector<std::string>& fields, const std::string& data) {
    const std::string header = Fields(fields);
    for (const std::string& part : {header, data}) {
      to.Put(static_cast<std::uint32_t>(part.size()));
      to.PutRaw(part.data(), part.size());
    }
  }

  void CloseChunk() {
    const std::string bytes = std::exchange(chunk_, Bytes()).Take();
    if (bytes.empty()) return;
    const std::array<const char*, 3> names = {"none", "bz2", "lz4"};
    Record(file_,
           {Op(5), std::string("compression=") + names.at(static_cast<std::size_t>(packing_)),
            Field("size", static_cast<std::uint32_t>(bytes.size()))},
           Packed(bytes));
    for (const auto& [id, count] : std::exchange(counts_, {})) {
      Record(file_, {Op(4), Field<std::uint32_t>("ver", 1), Field("conn", id), Field("count", count)},
             std::string(std::size_t{12} * count, '\0'));
    }
  }

  std::string Packed(std::string bytes) const {
    if (packing_ == BagPacking::kPlain) return bytes;
    if (packing_ == BagPacking::kLz4) {
      LZ4F_preferences_t checked = {};
      checked.frameInfo.contentChecksumFlag = LZ4F_contentChecksumEnabled;
      std::string out(LZ4F_compressFrameBound(bytes.size(), &checked), '\0');
      out.resize(LZ4F_compressFrame(out.data(), out.size(), bytes.data(), bytes.size(), &checked));
      return out;
    }
    std::string out(bytes.size() + bytes.size() / 100 + 600, '\0');
    auto size = static_cast<unsigned>(out.size());
    if (BZ2_bzBuffToBuffCompress(out.data(), &size, bytes.data(), static_cast<unsigned>(bytes.size()), 9, 0,
                                 0) != BZ_OK)
      throw std::logic_error("bzip2 fails");
    out.resize(size);
    return out;
  }

  BagPacking packing_;
  std::size_t chunk_bytes_;
  Bytes file_, chunk_;
  std::map<std::string, std::size_t> connections_;
  std::map<std::uint32_t, std::uint32_t> counts_;  // of messages in the chunk, by connection
};

namespace internal_bag {

inline void PutText(internal::ByteWriter& out, const std::string& text) {
  out.Put(static_cast<std::uint32_t>(text.size()));
  out.PutRaw(text.data(), text.size());
}

inline void PutHeader(internal::ByteWriter& out, double stamp_s) {
  out.Put<std::uint32_t>(0);
  out.Put(static_cast<std::uint32_t>(stamp_s));
  out.Put(static_cast<std::uint32_t>(std::lround(1e9 * (stamp_s - std::floor(stamp_s)))));
  PutText(out, "camera");
}

}  // namespace internal_bag

/// A sensor_msgs/Image.
inline std::string ImageMessage(const cv::Mat& image, const std::string& encoding, double stamp_s) {
  internal::ByteWriter out;
  internal_bag::PutHeader(out, stamp_s);
  out.Put(static_cast<std::uint32_t>(image.rows));
  out.Put(static_cast<std::uint32_t>(image.cols));
  internal_bag::PutText(out, encoding);
  out.Put<std::uint8_t>(0);
  out.Put(static_cast<std::uint32_t>(image.step));
  internal_bag::PutText(out, std::string(image.datastart, image.dataend));
  return out.Take();
}

/// A sensor_msgs/CompressedImage of the bytes of an image file.
inline std::string CompressedMessage(const std::vector<unsigned char>& file, const std::string& format,
                                     double stamp_s) {
  internal::ByteWriter out;
  internal_bag::PutHeader(out, stamp_s);
  internal_bag::PutText(out, format);
  internal_bag::PutText(out, std::string(file.begin(), file.end()));
  return out.Take();
}

/// A sensor_msgs/CameraInfo.
inline std::string ImuMessage(const ImuSample& sample) {
  internal::ByteWriter out;
  internal_bag::PutHeader(out, sample.stamp_s);
  out.Put(std::array<double, 4 + 9>{});  // orientation
  for (const double value : sample.gyro) out.Put(value);
  out.Put(std::array<double, 9>{});
  for (const double value : sample.acceleration) out.Put(value);
  out.Put(std::array<double, 9>{});
  return out.Take();
}
inline std::string CameraInfoMessage(const CameraInfo& info) {
  internal::ByteWriter out;
  internal_bag::PutHeader(out, 0);
  const auto put = [&](int value) { out.Put(static_cast<std::uint32_t>(value)); };
  put(info.height);
  put(info.width);
  internal_bag::PutText(out, info.model);
  put(static_cast<int>(info.lens.size()));
  for (const double value : info.lens) out.Put(value);
  out.Put(info.K);
  out.Put(info.R);
  out.Put(info.P);
  const ImageWindow& w = info.window;
  for (const int value : {w.binning_x, w.binning_y, w.x_offset, w.y_offset, w.height, w.width}) put(value);
  out.Put('\0');  // do_rectify
  return out.Take();
}
inline std::string CameraInfoMessage(cv::Size size, const std::array<double, 9>& K, const std::string& model,
                                     const std::vector<double>& lens) {
  CameraInfo info;
  info.width = size.width;
  info.height = size.height;
  info.K = K;
  info.model = model;
  info.lens = lens;
  return CameraInfoMessage(info);
}

}  // namespace tutti::testing
