#include "data/synthetic/image_change.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "data/synthetic/synthetic_random.h"
#include "data/synthetic/textures.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

using synthetic::Random;

// What an operation knows beside the image.
struct Context {
  int strength;
  std::uint64_t seed;       // of the whole sequence
  std::uint64_t operation;  // number of the operation
  int index;                // of the image

  bool Strong() const { return strength == 2; }
  // Random numbers of the sequence (`part`: which ones), and of this image alone.
  Random OfSequence(std::uint64_t part = 0) const {
    Random mixed(seed * 0x9E3779B97F4A7C15ULL + operation * 0xD1B54A32D192ED03ULL + part);
    return Random(mixed.Bits());
  }
  Random OfImage() const {
    Random mixed(OfSequence(0x1A6E).Bits() + static_cast<std::uint64_t>(index));
    return Random(mixed.Bits());
  }
};

cv::Mat LookUp(const cv::Mat& image, double (*curve)(double, double, double), double a, double b) {
  cv::Mat table(1, 256, CV_8UC1);
  for (int i = 0; i < 256; ++i) table.at<std::uint8_t>(i) = cv::saturate_cast<std::uint8_t>(curve(i, a, b));
  cv::Mat out;
  cv::LUT(image, table, out);
  return out;
}

// Noise of a short exposure: sigma^2 = shot * value + read^2, in grey levels.
cv::Mat Dark(const cv::Mat& image, const Context& context) {
  const double gain = context.Strong() ? 0.3 : 0.5, gamma = context.Strong() ? 1.6 : 1.25;
  const float shot = context.Strong() ? 0.4F : 0.25F, read = context.Strong() ? 3.0F : 2.0F;
  std::array<float, 256> mean{}, sigma{};
  for (std::size_t i = 0; i < 256; ++i) {
    mean[i] = static_cast<float>(255 * gain * std::pow(static_cast<double>(i) / 255, gamma));
    sigma[i] = std::sqrt(shot * mean[i] + read * read);
  }
  cv::Mat out = image.clone();
  Random random = context.OfImage();
  for (int y = 0; y < out.rows; ++y) {
    std::uint8_t* row = out.ptr(y);
    for (int x = 0; x < out.cols * out.channels(); ++x)
      row[x] = cv::saturate_cast<std::uint8_t>(mean[row[x]] + sigma[row[x]] * random.Normal());
  }
  return out;
}

cv::Mat Overexposed(const cv::Mat& image, const Context& context) {
  const double gain = (context.Strong() ? 2.4 : 1.7) * context.OfImage().In(0.94, 1.06);
  return LookUp(
      image, [](double v, double a, double b) { return a * v + b; }, gain, 12);
}

// A line of `length` pixels at `angle`, each of its points shared between the four nearest pixels.
cv::Mat LineKernel(double length, double angle) {
  const int half = std::max(1, static_cast<int>(std::ceil(length / 2)));
  cv::Mat kernel(2 * half + 1, 2 * half + 1, CV_32FC1, cv::Scalar(0));
  const int points = 8 * half;
  for (int k = 0; k <= points; ++k) {
    const double along = length * (static_cast<double>(k) / points - 0.5);
    const double x = half + along * std::cos(angle), y = half + along * std::sin(angle);
    const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
    for (int dy = 0; dy < 2; ++dy) {
      for (int dx = 0; dx < 2; ++dx) {
        const double weight = (1 - std::abs(x - x0 - dx)) * (1 - std::abs(y - y0 - dy));
        if (x0 + dx < kernel.cols && y0 + dy < kernel.rows && weight > 0)
          kernel.at<float>(y0 + dy, x0 + dx) += static_cast<float>(weight);
      }
    }
  }
  kernel /= cv::sum(kernel)[0];
  return kernel;
}

cv::Mat Blur(const cv::Mat& image, const Context& context) {
  Random random = context.OfImage();
  const double angle = random.In(0, M_PI);
  const double length = (context.Strong() ? 0.035 : 0.015) * image.cols * random.In(0.8, 1.2);
  cv::Mat out;
  cv::filter2D(image, out, -1, LineKernel(std::max(length, 2.0), angle), {-1, -1}, 0, cv::BORDER_REPLICATE);
  return out;
}

cv::Mat Jpeg(const cv::Mat& image, const Context& context) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, context.Strong() ? 8 : 15});
  return cv::imdecode(bytes, image.channels() == 1 ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR);
}

cv::Mat Half(const cv::Mat& image, const Context& context) {
  const int by = context.Strong() ? 3 : 2;
  cv::Mat out;
  cv::resize(image, out, {std::max(1, image.cols / by), std::max(1, image.rows / by)}, 0, 0, cv::INTER_AREA);
  return out;
}

cv::Mat Roll(const cv::Mat& image, const Context& context) {
  constexpr double kMostEnlarged = 1.35;
  const double angle = (context.Strong() ? 30 : 15) * M_PI / 180;
  const double w = image.cols, h = image.rows;
  const double full = std::cos(angle) + std::max(w / h, h / w) * std::sin(angle);
  const double degrees = angle * 180 / M_PI * (context.seed % 2 == 1 ? -1 : 1);
  const cv::Mat turn =
      cv::getRotationMatrix2D({static_cast<float>(0.5 * (w - 1)), static_cast<float>(0.5 * (h - 1))}, degrees,
                              std::min(full, kMostEnlarged));
  cv::Mat out;
  cv::warpAffine(image, out, turn, image.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT);
  return out;
}

// A block that drives through the image: its place does not depend on the image's size (1: width, height).
struct Occluder {
  double middle, bottom, width, height;  // of the image's
  cv::Mat texture;                       // CV_8UC1
  cv::Vec3b paint;                       // of colour images: the texture is tinted
};

cv::Rect Scaled(const Occluder& o, double scale, const cv::Size& size) {
  const double w = scale * o.width * size.width, h = scale * o.height * size.height;
  return {cvRound(o.middle * size.width - 0.5 * w), cvRound(o.bottom * size.height - h),
          std::max(1, cvRound(w)), std::max(1, cvRound(h))};
}

double CoveredPart(const std::vector<Occluder>& occluders, double scale, const cv::Size& size) {
  cv::Mat covered(size, CV_8UC1, cv::Scalar(0));
  const cv::Rect all({0, 0}, size);
  for (const Occluder& o : occluders) covered(Scaled(o, scale, size) & all).setTo(1);
  return static_cast<double>(cv::countNonZero(covered)) / static_cast<double>(size.area());
}

// Three blocks in lanes of their own. Each drives through and comes back with another look.
std::vector<Occluder> OccludersOf(const Context& context) {
  std::vector<Occluder> occluders;
  for (std::uint64_t lane = 0; lane < 3; ++lane) {
    Random of_lane = context.OfSequence(lane + 1);
    constexpr double kReach = 1.5;  // of the image's width, from its middle out of sight to the same again
    const double pace = of_lane.In(0.03, 0.09), speed = of_lane.Unit() < 0.5 ? -pace : pace;
    const double way = kReach * (static_cast<double>(lane) + of_lane.Unit()) / 3 + speed * context.index;
    const double rounds = std::floor(way / kReach);
    Random look = context.OfSequence((lane + 1) * 0x51ED2701ULL +
                                     static_cast<std::uint64_t>(static_cast<std::int64_t>(rounds) + 1000000));
    Occluder o;
    o.middle = way - rounds * kReach - 0.5 * (kReach - 1);
    o.bottom = look.In(0.75, 1.0);
    o.width = look.In(0.28, 0.42);
    o.height = look.In(0.4, 0.6);
    o.texture = synthetic::BusTexture(look.Bits());
    for (int c = 0; c < 3; ++c) o.paint[c] = static_cast<std::uint8_t>(look.Int(140, 255));
    occluders.push_back(std::move(o));
  }
  return occluders;
}

cv::Mat Occluded(const cv::Mat& image, const Context& context) {
  const double wanted = context.Strong() ? 0.4 : 0.25;
  const std::vector<Occluder> occluders = OccludersOf(context);
  double low = 0, high = 8;  // of the blocks' size: they come nearer or go away until they cover as much
  for (int k = 0; k < 14; ++k) {
    const double middle = 0.5 * (low + high);
    (CoveredPart(occluders, middle, image.size()) < wanted ? low : high) = middle;
  }
  cv::Mat out = image.clone();
  const cv::Rect all({0, 0}, image.size());
  for (const Occluder& o : occluders) {
    const cv::Rect r = Scaled(o, high, image.size()), seen = r & all;
    if (seen.empty()) continue;
    cv::Mat block;
    cv::resize(o.texture, block, r.size(), 0, 0,
               r.width < o.texture.cols ? cv::INTER_AREA : cv::INTER_LINEAR);
    block = block(seen - r.tl());
    if (image.channels() == 3) {
      cv::cvtColor(block, block, cv::COLOR_GRAY2BGR);
      cv::multiply(block, cv::Scalar(o.paint[0], o.paint[1], o.paint[2]), block, 1.0 / 255);
    }
    block.copyTo(out(seen));
  }
  return out;
}

cv::Mat Rain(const cv::Mat& image, const Context& context) {
  const double veil = context.Strong() ? 0.3 : 0.15, area = static_cast<double>(image.size().area());
  cv::Mat out;
  image.convertTo(out, CV_8U, 1 - veil, veil * 150);
  const double wind = context.OfSequence().In(-0.35, 0.35);  // slant of all streaks [rad]
  Random random = context.OfImage();
  cv::Mat drops(image.size(), CV_8UC1, cv::Scalar(0));
  const double unit = image.rows / 480.0;
  const int count = 1 + static_cast<int>((context.Strong() ? 0.0032 : 0.0013) * area / std::max(unit, 0.25));
  for (int k = 0; k < count; ++k) {
    const double a = random.Unit(), b = random.Unit(), near = a * b;  // near drops are few, long and thick
    const double length = unit * (12 + 55 * near), slant = wind + random.In(-0.05, 0.05);
    const double x = random.In(0, image.cols), y = random.In(-length, image.rows);
    const auto point = [](double px, double py) {  // 1/16 pixel
      return cv::Point(cvRound(16 * px), cvRound(16 * py));
    };
    cv::line(drops, point(x, y), point(x + length * std::sin(slant), y + length * std::cos(slant)),
             cv::Scalar(random.In(70, 165)), std::max(1, cvRound(unit * (0.7 + 2.2 * near))), cv::LINE_AA, 4);
  }
  cv::GaussianBlur(drops, drops, {3, 3}, 0.7);
  for (int y = 0; y < out.rows; ++y) {
    const std::uint8_t* drop = drops.ptr(y);
    std::uint8_t* row = out.ptr(y);
    for (int x = 0; x < out.cols * out.channels(); ++x) {
      const int cover = drop[x / out.channels()];
      row[x] = static_cast<std::uint8_t>((row[x] * (255 - cover) + 225 * cover + 127) / 255);
    }
  }
  return out;
}

using Operation = cv::Mat (*)(const cv::Mat&, const Context&);

const std::vector<std::pair<std::string, Operation>>& Operations() {
  static const std::vector<std::pair<std::string, Operation>> operations = {
      {"dark", Dark}, {"overexposed", Overexposed}, {"blur", Blur}, {"jpeg", Jpeg}, {"half", Half},
      {"roll", Roll}, {"occluded", Occluded},       {"rain", Rain}};
  return operations;
}

}  // namespace

const std::vector<std::string>& ImageChange::Names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const auto& [name, operation] : Operations()) all.push_back(name);
    return all;
  }();
  return names;
}

ImageChange ImageChange::Parse(const std::string& text) {
  const std::size_t colon = text.find(':');
  const std::string name = text.substr(0, colon);
  if (std::find(Names().begin(), Names().end(), name) == Names().end())
    throw InputError("'" + name + "': no such change of images; did you mean '" + NearestWord(name, Names()) +
                     "'?");
  if (colon == std::string::npos) return {name, 1};
  const std::string strength = text.substr(colon + 1);
  if (strength != "1" && strength != "2")
    throw InputError("'" + text + "': the strength is 1 (mild) or 2 (strong), as in " + name + ":2");
  return {name, strength == "1" ? 1 : 2};
}

cv::Mat ImageChange::Apply(const cv::Mat& image, std::uint64_t seed, int index) const {
  if (image.empty()) throw InputError("change of images: an image is empty");
  if (image.type() != CV_8UC1 && image.type() != CV_8UC3)
    throw InputError("change of images: an image is neither grey nor colour of 8 bits");
  const auto found = std::find_if(Operations().begin(), Operations().end(),
                                  [this](const auto& entry) { return entry.first == name_; });
  const auto number = static_cast<std::uint64_t>(found - Operations().begin());
  return found->second(image, {strength_, seed, number + 1, index});
}

}  // namespace tutti
