
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <opencv2/core/utility.hpp>
#include <opencv2/core/version.hpp>
#include <opencv2/dnn.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <system_error>
#include <vector>

#include "core/byte_stream.h"
#include "core/numbers.h"
#include "loopclosure/features/whole_image.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

constexpr double kLeastContrast = 0.5;     // deviation of an image with something to see [grey levels]
constexpr std::size_t kNearNames = 5;      // that a message about an unknown layer lists
constexpr std::size_t kLongestText = 300;  // of OpenCV's in a message
constexpr std::uintmax_t kMostBytes = 2000000000;  // of a network; protobuf reads no more than 2^31

using Names = std::vector<std::string>;

[[noreturn]] void Fail(const std::string& file, const std::string& what) {
  throw InputError(file + " (dnn.model): " + what);
}

// What OpenCV says, in one line that is not endless.
std::string Said(const std::exception& error) {
  const auto* of_opencv = dynamic_cast<const cv::Exception*>(&error);
  std::string text = of_opencv != nullptr ? of_opencv->err : error.what();
  std::replace(text.begin(), text.end(), '\n', ' ');
  if (text.size() > kLongestText) text = text.substr(0, kLongestText) + " ...";
  return "OpenCV " CV_VERSION " says: " + text;
}

std::string ReadFile(const std::string& file) {
  std::error_code ignored;  // nothing else is opened: one waits at a pipe without end
  std::ifstream in;
  if (std::filesystem::is_regular_file(file, ignored)) in.open(file, std::ios::binary);
  if (!in.is_open()) {
    Fail(file, "can't be read (no such file, or no permission); give the path of a network's ONNX file");
  }
  const std::uintmax_t size = std::filesystem::file_size(file, ignored);
  if (size > kMostBytes) Fail(file, "is larger than 2 GB, which no ONNX file is; give the path of one");
  std::string bytes(static_cast<std::size_t>(size), '\0');
  in.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!in) Fail(file, "can't be read to its end");
  return bytes;
}

cv::dnn::Net ReadNetwork(const std::string& file, const std::string& bytes) {
  cv::dnn::Net net;
  try {
    net = cv::dnn::readNetFromONNX(bytes.data(), bytes.size());
  } catch (const std::exception& error) {
    Fail(file, "is no ONNX file that OpenCV reads; export the network as docs/networks.md says (" +
                   Said(error) + ")");
  }
  if (net.empty()) Fail(file, "holds no network; export it again");
  // Whatever else this OpenCV has: the same answers on every machine's CPU.
  net.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
  net.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
  return net;
}

// OpenCV puts a prefix before the names of the file: "onnx_node!pool", "onnx_node_output_0!pooled".
std::string NameInFile(const std::string& name) {
  const std::size_t mark = name.find('!');
  return name.rfind("onnx_node", 0) == 0 && mark != std::string::npos ? name.substr(mark + 1) : name;
}

std::string Listed(const Names& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "'" : ", '") + NameInFile(name) + "'";
  return text;
}

// Nearest first.
Names Near(const std::string& name, Names candidates) {
  for (std::string& candidate : candidates) candidate = NameInFile(candidate);
  Names near;
  while (near.size() < kNearNames && !candidates.empty()) {
    near.push_back(NearestWord(name, candidates));
    candidates.erase(std::remove(candidates.begin(), candidates.end(), near.back()), candidates.end());
  }
  return near;
}

// OpenCV's name of the layer whose output is wanted.
std::string FindLayer(const std::string& file, const std::string& wanted, const cv::dnn::Net& net) {
  const Names outputs = net.getUnconnectedOutLayersNames();
  if (wanted.empty()) {
    if (outputs.size() == 1) return outputs.front();
    Fail(file, "has " + std::to_string(outputs.size()) + " outputs (" + Listed(outputs) +
                   "); say in dnn.layer which one is the descriptor");
  }
  Names all = outputs;
  const Names layers = net.getLayerNames();
  all.insert(all.end(), layers.begin(), layers.end());
  for (const std::string& name : all) {
    if (name == wanted || NameInFile(name) == wanted) return name;
  }
  Fail(file, "has no layer '" + wanted + "' (dnn.layer); near ones: " + Listed(Near(wanted, all)) +
                 "; its outputs: " + Listed(outputs));
}

std::string ShapeText(const cv::Mat& values) {
  std::string text;
  for (int d = 0; d < values.dims; ++d) text += (d > 0 ? " x " : "") + std::to_string(values.size[d]);
  return text;
}

// D at least 2 and all other dimensions 1: whether pooled values were flattened does not matter.
bool IsVector(const cv::Mat& values) {
  if (values.dims < 1 || values.total() < 2) return false;
  int longest = 0;
  for (int d = 0; d < values.dims; ++d) longest = std::max(longest, values.size[d]);
  return internal::Index(longest) == values.total();
}

// Blue, green, red, 8 bit.
cv::Mat InColour(const cv::Mat& image, const cv::Mat& grey) {
  if (image.type() == CV_8UC3) return image;
  cv::Mat colour;
  if (image.type() == CV_8UC4) {
    cv::cvtColor(image, colour, cv::COLOR_BGRA2BGR);
  } else {
    cv::cvtColor(grey, colour, cv::COLOR_GRAY2BGR);
  }
  return colour;
}

// 1 x 3 x height x width, CV_32F.
cv::Mat MakeBlob(const cv::Mat& colour, const DnnOptions& options) {
  const int sizes[] = {1, 3, colour.rows, colour.cols};
  cv::Mat blob(4, sizes, CV_32F);
  for (int c = 0; c < 3; ++c) {
    cv::Mat plane(colour.rows, colour.cols, CV_32F, blob.ptr<float>(0, c));
    cv::Mat channel;
    cv::extractChannel(colour, channel, options.swap_rb ? 2 - c : c);
    const auto i = internal::Index(c);
    const double factor = options.scale / options.stddev[i];
    channel.convertTo(plane, CV_32F, factor, -options.mean[i] * factor);
  }
  return blob;
}

}  // namespace

struct DnnDescriptor::Network {
  DnnOptions options;
  std::uint32_t checksum = 0;  // of the file
  std::string layer;           // OpenCV's name
  int width = 0;
  cv::dnn::Net net;
  std::mutex running;  // copies share the network, and it holds what it computes

  // Output of the layer, of any shape, in a matrix of its own; `colour` is of the network's size.
  cv::Mat Run(const cv::Mat& colour) {
    const cv::Mat blob = MakeBlob(colour, options);
    cv::Mat output;
    const std::lock_guard<std::mutex> lock(running);
    try {
      // Loops within a parallel loop run in its thread: OpenCV's shares of the work would else depend on the
      // number of threads.
      cv::parallel_for_(cv::Range(0, 1), [&](const cv::Range&) {
        net.setInput(blob);
        net.forward(layer).convertTo(output, CV_32F);
      });
    } catch (const std::exception& error) {
      Fail(options.model, "can't take an image of " + std::to_string(options.width) + " x " +
                              std::to_string(options.height) +
                              " pixels with 3 channels; set dnn.width and dnn.height to the size that it was "
                              "exported for (" +
                              Said(error) + ")");
    }
    return output;
  }
};

DnnDescriptor::DnnDescriptor(const DnnOptions& options) : network_(std::make_shared<Network>()) {
  const std::string problem = OutOfRange(options, "dnn.");
  if (!problem.empty()) throw InputError(problem);
  Network& network = *network_;
  network.options = options;
  const std::string bytes = ReadFile(options.model);
  network.checksum = internal::Crc32(bytes);
  network.net = ReadNetwork(options.model, bytes);
  network.layer = FindLayer(options.model, options.layer, network.net);
  const cv::Mat grey(options.height, options.width, CV_8UC3, cv::Scalar::all(128));
  const cv::Mat output = network.Run(grey);
  if (!IsVector(output)) {
    Fail(options.model,
         "layer '" + NameInFile(network.layer) + "' gives " + ShapeText(output) +
             " values, but a descriptor is a vector (1 x D, D at least 2); name another layer in "
             "dnn.layer, or export the network with its pooling");
  }
  network.width = static_cast<int>(output.total());
}

cv::Mat DnnDescriptor::Describe(const cv::Mat& image, const cv::Mat& grey, const cv::Mat& mask) const {
  if (grey.empty() || grey.type() != CV_8UC1 || std::min(grey.rows, grey.cols) < kMinSide) return {};
  const DnnOptions& options = network_->options;
  const cv::Mat seen = WithoutMasked(InColour(image, grey), mask);
  if (seen.empty()) return {};
  const bool smaller = options.width <= seen.cols && options.height <= seen.rows;
  cv::Mat sized;
  cv::resize(seen, sized, cv::Size(options.width, options.height), 0, 0,
             smaller ? cv::INTER_AREA : cv::INTER_LINEAR);
  cv::Scalar mean, deviation;
  cv::meanStdDev(sized, mean, deviation);
  if (std::max({deviation[0], deviation[1], deviation[2]}) < kLeastContrast) return {};
  const cv::Mat output = network_->Run(sized);
  if (!cv::checkRange(output)) {
    Fail(options.model,
         "gives a value that is not a finite number; set dnn.mean, dnn.scale and dnn.stddev to those that it "
         "was trained with, or export it in single precision");
  }
  return NormalisedDescriptor(output.reshape(1, 1));
}

int DnnDescriptor::width() const { return network_->width; }

std::string DnnDescriptor::Fingerprint() const {
  const DnnOptions& o = network_->options;
  std::ostringstream text;
  text.precision(9);
  text << network_->width << " values of network " << std::hex << network_->checksum << std::dec
       << ", layer '" << NameInFile(network_->layer) << "', " << o.width << " x " << o.height << " px, mean "
       << o.mean[0] << " " << o.mean[1] << " " << o.mean[2] << ", scale " << o.scale << ", stddev "
       << o.stddev[0] << " " << o.stddev[1] << " " << o.stddev[2] << (o.swap_rb ? ", RGB" : ", BGR");
  return text.str();
}

}  // namespace tutti
