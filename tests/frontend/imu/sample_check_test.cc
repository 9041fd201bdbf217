#include "frontend/imu/imu_examination.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "frontend/dataset/imu_file.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

std::vector<ImuSample> Samples(double seconds) {
  std::vector<ImuSample> samples;
  for (int i = 0; i * 0.005 < seconds; ++i) {
    ImuSample s;
    s.stamp_s = 50 + i * 0.005;
    s.gyro = {0.1 * std::sin(0.1 * i), 0.02, 0.3};
    s.acceleration = {0.5 * std::cos(0.13 * i), 0.3 * std::sin(0.29 * i), 9.8};
    samples.push_back(s);
  }
  return samples;
}

std::string Findings(const std::vector<ImuSample>& samples) {
  std::string text;
  for (const ImuFinding& f : CheckSamples(samples).findings) text += f.measured + "; " + f.advice + "\n";
  return text;
}

TEST(CheckSamples, HasNothingAgainstASoundImu) {
  const ImuReport report = CheckSamples(Samples(10));
  EXPECT_EQ(Findings(Samples(10)), "");
  EXPECT_NEAR(report.rate_hz, 200, 0.01);
  EXPECT_NEAR(report.duration_s, 10, 0.01);
  EXPECT_NEAR(report.acceleration_mps2, 9.81, 0.05);
}

TEST(CheckSamples, MeasuresNoiseAtRest) {
  const double gyro = 0.0005, acceleration = 0.004;  // densities
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::vector<ImuSample> samples = Samples(10);
  EXPECT_FALSE(CheckSamples(samples).noise) << "it moves";
  for (int i = 0; i < 12000; ++i) {
    ImuSample s;
    s.stamp_s = 60 + i * 0.005;
    const auto drawn = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
    s.gyro = Eigen::Vector3d(0.01, 0.02, -0.03) + gyro * std::sqrt(200) * drawn();
    s.acceleration = Eigen::Vector3d(0.2, 0, 9.8) + acceleration * std::sqrt(200) * drawn();
    samples.push_back(s);
  }
  const ImuReport report = CheckSamples(samples);
  ASSERT_TRUE(report.noise);
  EXPECT_NEAR(report.noise->rest_s, 60, 1);
  EXPECT_NEAR(report.noise->gyro_density, gyro, 0.25 * gyro);
  EXPECT_NEAR(report.noise->acceleration_density, acceleration, 0.25 * acceleration);
  ASSERT_GE(report.noise->tau_s.size(), 10U);
  EXPECT_NEAR(report.noise->gyro.front(), gyro * std::sqrt(200), 0.05 * gyro * std::sqrt(200));
}

TEST(CheckSamples, NamesEachContradictionWithItsRemedy) {
  const auto with = [](const auto& change) {
    std::vector<ImuSample> samples = Samples(10);
    change(samples);
    return Findings(samples);
  };
  EXPECT_NE(with([](auto& all) {
              for (auto& s : all) s.acceleration /= 9.80665;
            }).find("gravity in g; multiply"),
            std::string::npos);
  EXPECT_NE(with([](auto& all) {
              for (auto& s : all) s.acceleration.z() -= 9.8;
            }).find("gravity was taken out"),
            std::string::npos);
  EXPECT_NE(with([](auto& all) {
              for (auto& s : all) s.acceleration *= 2;
            }).find("not 9.8"),
            std::string::npos);
  const std::string gaps = with([](auto& all) {
    std::vector<ImuSample> kept;
    for (std::size_t i = 0; i < all.size(); ++i)
      if (i * 7 % 10 != 3) kept.push_back(all[i]);
    all = kept;
  });
  EXPECT_NE(gaps.find("10 % of the measurements are missing"), std::string::npos) << gaps;
  EXPECT_NE(with([](auto& all) {
              for (std::size_t i = 1000; i < all.size(); ++i) {
                all[i].gyro = all[1000].gyro;
                all[i].acceleration = all[1000].acceleration;
              }
            }).find("stuck: for 5.0 s"),
            std::string::npos);
  EXPECT_NE(with([](auto& all) { std::swap(all[10], all[20]); }).find("back in time"), std::string::npos);
  EXPECT_NE(with([](auto& all) {
              for (auto& s : all) s.stamp_s = 50 + 10 * (s.stamp_s - 50);
            }).find("20 times a second"),
            std::string::npos);
}

TEST(CheckSamples, OfAnotherRecordingCoverNoImages) {
  ImuReport report;
  CheckOverlap(Samples(10), 51, 59, &report);
  EXPECT_TRUE(report.findings.empty());
  CheckOverlap(Samples(10), 1051, 1059, &report);
  ASSERT_EQ(report.findings.size(), 1U);
  EXPECT_NE(report.findings[0].measured.find("cover 0 %"), std::string::npos);
}

TEST(ImuFile, ReadsEurocsCsvAndPlainText) {
  const auto csv = testing::FreshFile("data.csv",
                                      "#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z\n"
                                      "1403715523912143104,0.1,0.2,0.3,9.2,0.3,-3.1\n"
                                      "1403715523917143040,0.1,0.2,0.4,9.2,0.3,-3.2\n");
  const std::vector<ImuSample> samples = ReadImuFile(csv);
  ASSERT_EQ(samples.size(), 2U);
  EXPECT_NEAR(samples[1].stamp_s - samples[0].stamp_s, 0.005, 1e-6);
  EXPECT_EQ(samples[1].gyro, Eigen::Vector3d(0.1, 0.2, 0.4));
  EXPECT_EQ(samples[0].acceleration, Eigen::Vector3d(9.2, 0.3, -3.1));
  const auto text = testing::FreshFile("imu.txt", "# t w a\n12.5 1 2 3 4 5 6\n12.51 1 2 3 4 5 7\n");
  EXPECT_NEAR(ReadImuFile(text)[1].stamp_s, 12.51, 1e-9);
  const auto damaged = testing::FreshFile("bad.txt", "12.5 1 2 3 4 5 6\n12.51 1 2 3 4 5\n");
  try {
    ReadImuFile(damaged);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("bad.txt:2: has 6 columns"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace tutti
