// The member dnn: the descriptor of a network, and what is said of one that can't be used.
#include "loopclosure/features/whole_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>

#include "tests/loopclosure/features/small_networks.h"
#include "tests/loopclosure/features/textured_image.h"
#include "tests/support/error_of.h"
#include "tutti/core/error.h"
#include "tutti/loopclosure/features.h"

namespace tutti {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

// What a network without mean, scale and deviation sees: grey levels.
DnnOptions Plain(const std::filesystem::path& model) {
  DnnOptions options;
  options.model = model.string();
  options.width = 64;
  options.height = 48;
  options.mean = {0, 0, 0};
  options.scale = 1;
  options.stddev = {1, 1, 1};
  return options;
}

cv::Mat Describe(const DnnOptions& options, const cv::Mat& image, const cv::Mat& mask = cv::Mat()) {
  return DnnDescriptor(options).Describe(image, ToGrey8(image), mask);
}

// Left half blue 10, green 20, red 30; right half 50, 80, 120. Means 30, 50, 75.
cv::Mat TwoColours(int width = 64, int height = 48) {
  cv::Mat image(height, width, CV_8UC3, cv::Scalar(10, 20, 30));
  image.colRange(width / 2, width) = cv::Scalar(50, 80, 120);
  return image;
}

void ExpectIs(const cv::Mat& descriptor, const std::vector<float>& values) {
  ASSERT_EQ(descriptor.rows, 1);
  ASSERT_EQ(descriptor.type(), CV_32F);
  ASSERT_EQ(descriptor.cols, static_cast<int>(values.size()));
  EXPECT_NEAR(cv::norm(descriptor), 1.0, 1e-6);
  const cv::Mat wanted = cv::Mat(values, true).reshape(1, 1);
  EXPECT_LT(cv::norm(descriptor - wanted / cv::norm(wanted)), 1e-4)
      << descriptor << " is not along " << wanted;
}

std::string ProblemOf(const DnnOptions& options) {
  return testing::ErrorOf([&] { const DnnDescriptor descriptor(options); });
}

class DnnDescriptorTest : public testing::SmallNetworks {};

TEST_F(DnnDescriptorTest, GivesTheMeansThatTheNetworkComputes) {
  DnnOptions options = Plain(Network("means"));
  ExpectIs(Describe(options, TwoColours()), {75, 50, 30, 155});
  options.swap_rb = false;
  ExpectIs(Describe(options, TwoColours()), {30, 50, 75, 155});
  options.swap_rb = true;
  options.mean = {5, 6, 7};
  options.scale = 2;
  options.stddev = {1, 2, 4};
  ExpectIs(Describe(options, TwoColours()), {140, 44, 11.5, 195.5});
}

TEST_F(DnnDescriptorTest, TakesImagesOfAnySizeAndKind) {
  const DnnOptions options = Plain(Network("means"));
  ExpectIs(Describe(options, TwoColours(640, 480)), {75, 50, 30, 155});
  ExpectIs(Describe(options, TwoColours(32, 24)), {75, 50, 30, 155});
  cv::Mat with_alpha;
  cv::cvtColor(TwoColours(), with_alpha, cv::COLOR_BGR2BGRA);
  ExpectIs(Describe(options, with_alpha), {75, 50, 30, 155});
  // Grey: three channels of the same; 16 bit and float from least to most.
  const cv::Mat grey = testing::TexturedImage(5, 64, 48);
  cv::Mat deep, floats;
  grey.convertTo(deep, CV_16U, 200);
  grey.convertTo(floats, CV_32F);
  for (const cv::Mat& image : {grey, deep, floats}) ExpectIs(Describe(options, image), {1, 1, 1, 3});
}

TEST_F(DnnDescriptorTest, LeavesOutWhatIsMasked) {
  const DnnOptions options = Plain(Network("means"));
  cv::Mat mask(48, 64, CV_8UC1, cv::Scalar(255));
  mask.colRange(0, 16) = 0;  // takes the mean of what is left of the left half, and of the right one
  const float share = 1.0f / 3;
  const float r = 30 * share + 120 * (1 - share), g = 20 * share + 80 * (1 - share),
              b = 10 * share + 50 * (1 - share);
  const cv::Mat descriptor = Describe(options, TwoColours(), mask);
  const cv::Mat wanted = (cv::Mat_<float>(1, 4) << r, g, b, r + g + b);
  EXPECT_LT(cv::norm(descriptor - wanted / cv::norm(wanted)), 0.005);  // the mean is rounded to a grey level
  EXPECT_TRUE(Describe(options, TwoColours(), cv::Mat::zeros(48, 64, CV_8UC1)).empty());
}

TEST_F(DnnDescriptorTest, SitsOutWhereThereIsNothingToSee) {
  const DnnDescriptor descriptor(Plain(Network("means")));
  const std::vector<cv::Mat> images = {
      cv::Mat(), cv::Mat::ones(1, 1, CV_8UC1), cv::Mat(120, 160, CV_8UC3, cv::Scalar(9, 8, 7)),
      cv::Mat(7, 900, CV_8UC1, cv::Scalar(9)),
      cv::Mat(40, 40, CV_32F, cv::Scalar(std::numeric_limits<float>::quiet_NaN()))};
  for (const cv::Mat& image : images) {
    EXPECT_TRUE(descriptor.Describe(image, ToGrey8(image), cv::Mat()).empty()) << image.size();
  }
}

TEST_F(DnnDescriptorTest, LayersHaveTheNamesOfTheFile) {
  DnnOptions options = Plain(Network("means"));
  const cv::Mat whole = Describe(options, TwoColours());
  for (const char* layer : {"pool", "flatten", "descriptor", "onnx_node!pool"}) {
    options.layer = layer;
    if (std::strchr(layer, '!') != nullptr && CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR < 6) continue;
    EXPECT_EQ(cv::norm(Describe(options, TwoColours()) - whole), 0.0) << layer;
  }
  options.layer = "pol";
  EXPECT_THAT(ProblemOf(options),
              AllOf(HasSubstr("means.onnx"), HasSubstr("no layer 'pol' (dnn.layer); near ones: 'pool'"),
                    HasSubstr("its outputs: 'descriptor'")));
  options.layer = "mix";
  EXPECT_THAT(ProblemOf(options),
              AllOf(HasSubstr("layer 'mix' gives 1 x 4 x 48 x 64 values"), HasSubstr("is a vector")));
  options = Plain(Network("two"));
  EXPECT_THAT(ProblemOf(options), AllOf(HasSubstr("2 outputs ('mean', 'most')"), HasSubstr("dnn.layer")));
  options.layer = "most";
  ExpectIs(Describe(options, TwoColours()), {120, 80, 50});
}

TEST_F(DnnDescriptorTest, SaysWhatIsWrongWithAFile) {
  DnnOptions options = Plain(folder() / "nowhere.onnx");
  EXPECT_THAT(ProblemOf(options),
              AllOf(HasSubstr("nowhere.onnx (dnn.model): can't be read"), HasSubstr("give the path")));
  options.model = folder().string();
  EXPECT_THAT(ProblemOf(options), HasSubstr("can't be read"));
  const auto write = [&](const std::string& bytes) {
    options.model = (folder() / "bad.onnx").string();
    std::ofstream(options.model, std::ios::binary) << bytes;
  };
  std::ifstream in(Network("deep"), std::ios::binary);
  const std::string whole((std::istreambuf_iterator<char>(in)), {});
  for (const std::string& bytes :
       {std::string(), std::string("no network\n"), whole.substr(0, whole.size() / 2)}) {
    write(bytes);
    EXPECT_THAT(ProblemOf(options),
                AllOf(HasSubstr("bad.onnx (dnn.model): is no ONNX file that OpenCV reads"),
                      HasSubstr("OpenCV 4"), Not(HasSubstr("\n"))))
        << bytes.size();
  }
  std::filesystem::resize_file(options.model, std::uintmax_t{300} << 30);  // sparse: no byte of it is there
  EXPECT_THAT(ProblemOf(options), HasSubstr("bad.onnx (dnn.model): is larger than 2 GB"));
}

TEST_F(DnnDescriptorTest, SaysWhatIsWrongWithAnOutput) {
  EXPECT_THAT(ProblemOf(Plain(Network("map"))), HasSubstr("layer 'mixed' gives 1 x 4 x 48 x 64 values"));
  EXPECT_THAT(ProblemOf(Plain(Network("one"))), HasSubstr("gives 1 x 1 values"));
  EXPECT_THAT(testing::ErrorOf([&] { Describe(Plain(Network("huge")), TwoColours()); }),
              AllOf(HasSubstr("huge.onnx"), HasSubstr("not a finite number"), HasSubstr("dnn.scale")));
}

TEST_F(DnnDescriptorTest, SaysThatANetworkTakesAnotherSize) {
  DnnOptions options = Plain(Network("sized"));
  EXPECT_EQ(DnnDescriptor(options).width(), 5);
  options.width = 80;
  EXPECT_THAT(ProblemOf(options), AllOf(HasSubstr("sized.onnx"), HasSubstr("an image of 80 x 48 pixels"),
                                        HasSubstr("set dnn.width and dnn.height"), HasSubstr("OpenCV 4")));
  options.width = 15;
  EXPECT_EQ(ProblemOf(options), "dnn.width must be 16 to 4096 [px], not 15");
}

TEST_F(DnnDescriptorTest, ReadsTheHeadOfPublicModels) {
  DnnOptions options;  // of ImageNet
  options.model = Network("gem").string();
  options.width = 64;
  options.height = 48;
  const DnnDescriptor descriptor(options);
  ASSERT_EQ(descriptor.width(), 32);
  const cv::Mat place = testing::TexturedImage(1), another = testing::TexturedImage(2);
  const cv::Mat a = descriptor.Describe(place, place, cv::Mat());
  EXPECT_NEAR(cv::norm(a), 1.0, 1e-6);
  EXPECT_GT(a.dot(descriptor.Describe(testing::SeenAgain(place), testing::SeenAgain(place), cv::Mat())),
            a.dot(descriptor.Describe(another, another, cv::Mat())));
}

TEST_F(DnnDescriptorTest, SameBytesForAnyNumberOfThreads) {
  DnnOptions options = Plain(Network("deep"));
  options.width = 157;
  options.height = 117;
  const DnnDescriptor descriptor(options);
  const cv::Mat image = testing::TexturedImage(3, 400, 300);
  const int threads = cv::getNumThreads();
  cv::Mat first;
  for (const int count : {1, 2, 4}) {
    cv::setNumThreads(count);
    const cv::Mat described = descriptor.Describe(image, image, cv::Mat());
    ASSERT_EQ(described.cols, 131);
    if (first.empty()) first = described;
    EXPECT_EQ(std::memcmp(described.data, first.data, first.total() * first.elemSize()), 0) << count;
  }
  cv::setNumThreads(threads);
}

TEST_F(DnnDescriptorTest, FingerprintTellsNetworksAndWhatTheyGetApart) {
  const DnnOptions options = Plain(Network("means"));
  const auto fingerprint = [](const DnnOptions& o) { return DnnDescriptor(o).Fingerprint(); };
  const std::string own = fingerprint(options);
  EXPECT_THAT(own, AllOf(HasSubstr("4 values"), HasSubstr("64 x 48 px"), HasSubstr("'descriptor'"),
                         HasSubstr("RGB")));
  DnnOptions moved = options;
  moved.model = (folder() / "moved.onnx").string();
  std::filesystem::copy_file(options.model, moved.model);
  EXPECT_EQ(fingerprint(moved), own);
  EXPECT_NE(fingerprint(Plain(Network("other"))), own);
  const std::vector<std::function<void(DnnOptions&)>> changes = {
      [](DnnOptions& o) { o.width = 72; },     [](DnnOptions& o) { o.height = 56; },
      [](DnnOptions& o) { o.mean[1] = 1; },    [](DnnOptions& o) { o.scale = 0.5; },
      [](DnnOptions& o) { o.stddev[2] = 2; },  [](DnnOptions& o) { o.swap_rb = false; },
      [](DnnOptions& o) { o.layer = "pool"; },
  };
  for (const auto& change : changes) {
    DnnOptions changed = options;
    change(changed);
    EXPECT_NE(fingerprint(changed), own);
  }
}

}  // namespace
}  // namespace tutti
